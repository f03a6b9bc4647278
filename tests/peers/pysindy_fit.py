"""Coefficients of PySINDy for a run on standard input: a CSV of dt, outputs and inputs.

First line: dt,number of outputs,degree,threshold,alpha. Then one row a sample. Answers with one JSON list of
coefficient rows, columns in PySINDy's order of terms."""

import json
import sys

import numpy as np
import pysindy as ps

dt, outputs, degree, threshold, alpha = sys.stdin.readline().split(",")
data = np.loadtxt(sys.stdin, delimiter=",")
n = int(outputs)
model = ps.SINDy(
    optimizer=ps.STLSQ(threshold=float(threshold), alpha=float(alpha)),
    feature_library=ps.PolynomialLibrary(degree=int(degree)),
    differentiation_method=ps.FiniteDifference(order=2),
)
model.fit(data[:, :n], t=float(dt), u=data[:, n:])
print(json.dumps(model.coefficients().tolist()))
