"""Writes the workbook of this folder (openpyxl 3.1): python make_xlsx.py FILE"""
import datetime as dt
import sys

from openpyxl import Workbook
from openpyxl.styles import numbers

book = Workbook()
start = dt.datetime(2026, 4, 7, 7, 44)

sheet = book.active
sheet.title = "gnss"
sheet.append(["Log of the otter"])
sheet.append([])
sheet.append(["vessel", 3])
sheet.append(["time", "lat [deg]", "sog [kn]", "fix", "mode", None, "quality"])
for i in range(120):
    sog = None if i % 10 == 9 else 1.25 * i
    row = [start + dt.timedelta(milliseconds=769 + 200 * i), 63.44 + i * 1e-6, sog, i % 2 == 0, "auto", None, 4]
    sheet.append(row)
    sheet.cell(sheet.max_row, 1).number_format = 'yyyy-mm-dd"T"hh:mm:ss.000'
sheet["G10"] = "#N/A"

sheet = book.create_sheet("imu & more")
sheet.append(["t", "wz", "acc_x", "clock", "day"])
sheet.append(["s", "rad/s", "m/s2", "-", ""])
for i in range(60):
    sheet.append([0.02 * i, -0.00255 * i, -0.402, dt.time(7, 44, i), dt.date(2026, 4, 7)])

sheet = book.create_sheet("iso")
sheet.append(["servo [us]", "stamp"])
sheet.append([1824, "2026-04-07T07:44:00.003Z"])
sheet.append([1884, "2026-04-07 09:44:00,111+02:00"])

sheet = book.create_sheet("rows")
sheet.append(["u [m/s]", "v [m/s]"])
sheet.append([1, 2])
sheet.append([None, None])
sheet.append([3, 4])

sheet = book.create_sheet("notes")
sheet.append(["nothing", "but", "texts"])
sheet.append(["a", "b", "c"])
book.create_chartsheet("chart")
book.save(sys.argv[1])
