"""Writes the Parquet files of this folder and their values (pyarrow 26): python make_parquet.py FOLDER [all]

Each file has the rows of parquet.csv: the stamp [ns] and a value of each field, empty where there is none. With `all`,
each codec is combined with each version of the pages and each encoding.
"""
import csv
import datetime as dt
import decimal
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

N = 120
START = 1_775_547_840_000_000_000


def table():
    gap = lambda i, k: i % k == k - 1 or 60 <= i < 80
    with_gaps = lambda k, f: [None if gap(i, k) else f(i) for i in range(N)]
    unit = lambda name, kind, unit: pa.field(name, kind, metadata={"unit": unit})
    columns = [
        (pa.field("ordinal", pa.int32(), nullable=False), range(N)),
        (pa.field("time", pa.timestamp("us", "UTC")), [START // 1000 + 20_000 * i + i % 7 for i in range(N)]),
        (unit("f64", pa.float64(), "m/s"), with_gaps(5, lambda i: 0.1 * i - 7)),
        (unit("f32", pa.float32(), "deg"), with_gaps(7, lambda i: 0.37 * i)),
        (pa.field("i8", pa.int8()), with_gaps(11, lambda i: i % 250 - 125)),
        (pa.field("i64", pa.int64()), with_gaps(6, lambda i: (-1) ** i * i**5)),
        (pa.field("i64_wide", pa.int64(), nullable=False), [(-1) ** i * (2**63 - 1 - i) for i in range(N)]),
        (pa.field("i32_wide", pa.int32()), [(-1) ** i * (2**31 - 1 - i) for i in range(N)]),
        (pa.field("u8", pa.uint8()), [255 - i % 256 for i in range(N)]),
        (pa.field("u32", pa.uint32()), [2**32 - 1 - i for i in range(N)]),
        (pa.field("u64", pa.uint64()), [2**64 - 1 - 4096 * i for i in range(N)]),
        (pa.field("armed", pa.bool_()), with_gaps(9, lambda i: i % 3 == 0 or 20 < i < 45)),
        (pa.field("constant", pa.int32()), [1500] * N),
        (pa.field("empty", pa.float64()), [None] * N),
        (pa.field("later [m]", pa.float64()), [None] * (N - 10) + [1.5] * 10),
        (pa.field("day", pa.date32()), [dt.date(2026, 4, 7) + dt.timedelta(i) for i in range(N)]),
        (pa.field("stamp_ms", pa.timestamp("ms")), [1_775_547_840_000 + 20 * i for i in range(N)]),
        (pa.field("lag", pa.duration("us")), [1000 * i for i in range(N)]),
        (pa.field("text", pa.string()), with_gaps(4, lambda i: "mode" + str(i // 50))),
        (pa.field("price", pa.decimal128(9, 2)), [decimal.Decimal(i) for i in range(N)]),
        (pa.field("list", pa.list_(pa.float64())), [[1.0] * (i % 3) for i in range(N)]),
        (pa.field("pose", pa.struct([("x", pa.float64())])), [{"x": 1.0}] * N),
        (pa.field("last", pa.float64()), [float(i) for i in range(N)]),
    ]
    fields = [field for field, _ in columns]
    return pa.table([pa.array(list(values), field.type) for field, values in columns], pa.schema(fields))


def number(value, kind):
    if value is None:
        return ""
    if pa.types.is_date(kind):
        return repr(float((value - dt.date(1970, 1, 1)).days))
    if pa.types.is_timestamp(kind):
        return repr(value.replace(tzinfo=dt.timezone.utc).timestamp())
    if pa.types.is_duration(kind):
        return repr(float(value // dt.timedelta(microseconds=1)))
    return repr(float(value))


def write(folder, name, **options):
    path = folder / f"{name}.parquet"
    rows = table()
    pq.write_table(rows, path, row_group_size=70, data_page_size=128, write_batch_size=16, write_statistics=False, **options)
    back = pq.read_table(path)
    skip = {"time", "text", "price", "list", "pose"}
    kept = [c for c in back.column_names if c not in skip]
    with open(folder / "parquet.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["stamp", *kept])
        stamps = back["time"].cast(pa.int64()).to_pylist()
        scale = {"us": 1000, "ns": 1}[back["time"].type.unit]
        values = [[number(v, back[c].type) for v in back[c].to_pylist()] for c in kept]
        writer.writerows([scale * s, *v] for s, *v in zip(stamps, *values))


ENCODINGS = {
    "plain": dict(use_dictionary=False),
    "dictionary": dict(use_dictionary=True),
    "delta": dict(
        use_dictionary=False,
        column_encoding={
            c: "DELTA_BINARY_PACKED" for c in ["ordinal", "time", "i8", "i64", "i64_wide", "i32_wide", "u8", "u32", "u64", "constant", "day"]
        } | {"armed": "RLE"},
    ),
    "split": dict(
        use_dictionary=False,
        column_encoding={
            c: "BYTE_STREAM_SPLIT" for c in ["f64", "f32", "i64", "i64_wide", "i32_wide", "u32", "empty", "last", "time"]
        },
    ),
}

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    if sys.argv[2:] == ["all"]:
        for codec in ["none", "snappy", "gzip", "zstd", "lz4"]:
            for version in ["1.0", "2.0"]:
                for encoding, options in ENCODINGS.items():
                    write(folder, f"{codec}_v{version[0]}_{encoding}", compression=codec, data_page_version=version,
                          write_page_checksum=codec == "gzip", **options)
    else:
        for codec, version, encoding in [("gzip", "1.0", "plain"), ("lz4", "2.0", "dictionary"),
                                         ("zstd", "2.0", "delta"), ("snappy", "1.0", "split")]:
            write(folder, f"{codec}_v{version[0]}_{encoding}", compression=codec, data_page_version=version,
                  write_page_checksum=codec == "gzip", **ENCODINGS[encoding])
    write(folder, "zstd_v1_int96", compression="zstd", use_deprecated_int96_timestamps=True)
