#!/usr/bin/env python3
"""Compares what `hydroid inspect --json` reads of public logs with independent readers.

  pip install numpy pandas pymavlink pyulog rosbags mcap pynmea2
  HYDROID_DATA=FOLDER HYDROID_COMMAND=hydroid python check.py [FILE...]

FOLDER, or FOLDER/wild, holds the files of EXPECTED. Of a file that is read, the topics, their rows, first and last stamps (within 20 ms),
and minimum, maximum and missing values of all numeric fields that the other reader knows must agree. Of a refusal, the text must."""
import datetime, json, math, os, re, sqlite3, subprocess, sys, warnings
from pathlib import Path
import numpy as np

# file: (reader, topics, rows, fields that are compared), or a part of the refusal
EXPECTED = {
    **dict.fromkeys(("anemobox_rudder.log", "nmea2000raw.log", "tinylog.txt.gz"), "compressed by gzip"),
    "candumpSample1.txt": "line 9: 4 cells where the header names 3 columns",
    "merrimac-ydwg-2020.txt": "line 7: 5 cells where the header names 4 columns",
    "candump_alinghi.txt": "no table of numbers", "kolmap.gpx": "is GPX",
    "libais_types.nmea": "no NMEA 0183 sentence is whole", "small.tlog": "telemetry log of MAVLink",
    "astra_regata.log": ("csv", 1, 7036, 17), "kolmak_2023_09_07.csv": ("csv", 1, 1129, 15),
    "rowdy_part.csv": ("csv", 1, 6, 17), "sample3_GPSMAP4008_NMEA2000_6_21_2015_16_7_59.csv": ("csv", 1, 3355, 8),
    "small.BIN": ("dataflash", 38, 6282, 339), "delorean_00000041.BIN": ("dataflash", 64, 66630, 593),
    "mcap_test_ulog.ulg": ("ulog", 95, 4272, 2016), "sample_log_small.ulg": ("ulog", 70, 14604, 1099),
    **dict.fromkeys(("example.bag", "example-bz2.bag", "example-lz4.bag"), ("rosbags", 9, 8647, 51)),
    "example-unsorted-chunks.bag": ("rosbags", 1, 3, 0), "no-messages.bag": ("rosbags", 0, 0, 0),
    **dict.fromkeys(("vtec_iteration1a_trialnu_1.bag", "vtec_iteration1a_trialnu_2x5_25.bag"), ("rosbags", 9, 18369, 11)),
    "topics_and_services.db3": ("db3", 1, 7, 6), "wbag_0.db3": ("db3", 8, 1246, 0), "wbag_0.mcap": ("mcap", 8, 1246, 0),
    "NmeaSampleData.txt": ("nmea", 3, 13407, 17), "TrimbleR2SampleData.txt": ("nmea", 9, 306, 54),
    "gofree-merrimac.log": ("nmea", 11, 2793, 37), "n2kd-183-merrimac.log": ("nmea", 5, 528, 7),
    "nais400-merrimac.log": ("nmea", 3, 46, 17), "nmea_log.txt": ("nmea", 3, 274, 15), "plaka.log": ("nmea", 9, 65250, 22),
    "psaros0821.TXT": ("nmea", 7, 28640, 19), "pynmea2_data.log": ("nmea", 2, 2, 11), "tinylog.txt": ("nmea", 7, 36, 19),
    **dict.fromkeys(("ikonvert.log", "libais_tagblock.nmea"), ("nmea", 0, 0, 0)),
}
FIELDS = {  # fields of hydroid in sentences of NMEA, and their names in pynmea2
    "latitude": "latitude", "longitude": "longitude", "sog": "spd_over_grnd spd_over_grnd_kts", "sog_kmh": "spd_over_grnd_kmph",
    "cog": "true_course true_track", "cog_magnetic": "mag_track", "quality": "gps_qual", "satellites": "num_sats",
    "hdop": "horizontal_dil hdop", "altitude": "altitude", "geoid_separation": "geo_sep", "age": "age_gps_data",
    "heading": "heading heading_true", "heading_magnetic": "heading_magnetic", "speed": "wind_speed water_speed_knots",
    "speed_kmh": "water_speed_km", "angle": "wind_angle", "depth": "depth depth_meters", "offset": "offset", "rms": "rms",
    "semi_major": "std_dev_major", "semi_minor": "std_dev_minor", "orientation": "orientation", "day": "day", "month": "month", "year": "year"}

def add(topics, topic, stamp, fields):
    stamps, columns = topics.setdefault(topic, ([], {}))
    for name, value in fields.items():
        columns.setdefault(name, [math.nan] * len(stamps)).append(math.nan if value is None or value == "" else float(value))
    stamps.append(stamp)
    for column in columns.values():
        column.extend([math.nan] * (len(stamps) - len(column)))

def numbers(prefix, x, out):
    if isinstance(x, (bool, int, float, np.number)):
        out[prefix] = x
    elif isinstance(x, (list, tuple, np.ndarray)):
        for i, e in enumerate(x):
            numbers(f"{prefix}[{i}]", e, out)
    else:
        for name in set(getattr(x, "__dataclass_fields__", ())) - {"__msgtype__"}:
            numbers(f"{prefix}.{name}" if prefix else name, getattr(x, name), out)
    return out

def message(topics, topic, received, m):
    stamp = getattr(getattr(m, "header", None), "stamp", None)
    fields = {k: v for k, v in numbers("", m, {}).items() if not k.startswith("header.stamp")}
    add(topics, topic, (stamp.sec + stamp.nanosec * 1e-9 if stamp else 0) or received * 1e-9, fields)

def rosbags(path, topics):
    from rosbags.highlevel import AnyReader
    with AnyReader([path]) as reader:
        for c, received, raw in reader.messages():
            message(topics, c.topic, received, reader.deserialize(raw, c.msgtype))

def ros2(rows, topics):
    from rosbags.typesys import Stores, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    for topic, kind, received, raw in rows:
        if kind in store.types:
            message(topics, topic, received, store.deserialize_cdr(raw, kind))

def db3(path, topics):
    ros2(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True).execute(
        "select name, type, timestamp, data from messages join topics on topics.id = topic_id"), topics)

def mcap(path, topics):
    from mcap.reader import make_reader
    ros2(((c.topic, s.name, m.log_time, m.data) for s, c, m in make_reader(open(path, "rb")).iter_messages()), topics)

def ulog(path, topics):
    from pyulog import ULog
    data = ULog(str(path)).data_list
    gps = next(d.data for d in data if "gps_position" in d.name)
    start = np.median(gps["time_utc_usec"].astype(float) - gps["timestamp"].astype(float))
    for d in data:
        fields = {k: v for k, v in d.data.items() if k != "timestamp"}
        topics[d.name + (f"[{d.multi_id}]" if d.multi_id else "")] = ((d.data["timestamp"] + start) * 1e-6, fields)

def dataflash(path, topics):
    from pymavlink import DFReader
    log, scales = DFReader.DFReader_binary(str(path)), {}
    while (m := log.recv_msg()) is not None:
        kind, f = m.get_type(), m.fmt
        if kind == "FMTU":
            scales[m.FmtType] = [log.mult_lookup.get(c) or 1 for c in m.MultIds]
        elif kind not in ("FMT", "UNIT", "MULT", "PARM"):
            i = getattr(m, f.instance_field) if f.instance_field else 0
            fields = {k: getattr(m, k) * (s if f.msg_mults[n] is None else 1)  # pymavlink applies only the multipliers of the format
                      for n, (k, s) in enumerate(zip(f.columns, scales[f.type])) if isinstance(getattr(m, k), (int, float))}
            add(topics, kind + (f"[{i}]" if i else ""), m._timestamp, fields)

def nmea(path, topics):
    import pynmea2
    parsed, first, day, last = [], {}, 0, 0
    for line in path.read_text(errors="replace").splitlines():
        try:
            parsed.append(("$" in line[1:], pynmea2.parse(line[line.index("$"):].strip(), check=True)))
        except (ValueError, pynmea2.ParseError):
            pass
    dates = [m.datestamp for _, m in parsed if getattr(m, "sentence_type", "") == "RMC" and m.datestamp]
    if dates:
        day = datetime.datetime.combine(dates[0], datetime.time(), datetime.timezone.utc).timestamp()
    for has_arrival, m in parsed:
        kind = getattr(m, "sentence_type", None)
        if kind not in "RMC GGA GLL GNS VTG HDT HDG HDM VHW MWV DPT DBT ZDA GST".split():
            continue
        topic = kind + ("[T]" if kind == "MWV" and m.reference == "T" else "")
        topic += f"[{m.talker}]" if first.setdefault(topic, m.talker) != m.talker else ""
        known = [n for n in (*m.name_to_idx, *(("latitude", "longitude") if hasattr(m, "lat") else ()))]
        fields = {c: getattr(m, n) for c, names in FIELDS.items() for n in names.split() if n in known}
        if hasattr(m, "lat") and not m.lat:
            fields["latitude"] = fields["longitude"] = None
        if kind == "MWV":
            scale = {"N": 1852 / 3600, "K": 1 / 3.6, "M": 1}[m.wind_speed_units]
            fields["speed"] = float(m.wind_speed) * scale if m.wind_speed is not None else None
            fields = {k: None if m.status == "V" else v for k, v in fields.items()}
        clock = getattr(m, "timestamp", None)
        if clock:
            fields["utc_s"] = clock.hour * 3600 + clock.minute * 60 + clock.second + clock.microsecond * 1e-6
            day, last = day + 86400 * (fields["utc_s"] < last - 43200), fields["utc_s"]
        add(topics, topic, day + last if clock and not has_arrival else math.nan, fields)

def csv(path, topics):
    import pandas
    lines = path.read_text().splitlines()
    header = next(i for i, line in enumerate(lines) if re.search("[,\\t]", line))
    frame = pandas.read_csv(path, sep="\t" if "\t" in lines[header] else ",", header=header, skip_blank_lines=False, index_col=False)
    topics[path.name] = ([math.nan] * len(frame), {c.strip(): frame[c] for c in frame if frame[c].dtype.kind in "if"})

def compare(found, topics):
    """Numbers of fields and of topics with stamps that were compared, and contradictions."""
    fields, stamps, wrong = 0, 0, []
    if "columns" in found:
        columns = [{"column": c["name"], "low": c["min"], "high": c["max"], "missing": c["missing"]} for c in found["columns"]]
        found["topics"] = [{"name": next(iter(topics)), "rows": found["rows"], "fields": columns}]
    names = {t["name"] for t in found["topics"]}
    wrong += [f"topics of one reader only: {sorted(names ^ set(topics))}"] * (names != set(topics))
    for t in (t for t in found["topics"] if t["name"] in topics):
        times, columns = topics[t["name"]]
        wrong += [f"{t['name']}: {t['rows']} rows, the judge has {len(times)}"] * (t["rows"] != len(times))
        known = [x for x in times if math.isfinite(x)]
        if known and t.get("start_s") is not None:
            stamps += 1
            a, b = (t["start_s"], t["start_s"] + t["duration_s"]), (min(known), max(known))
            if len(times) > 1 and times[-1] == times[-2]:  # hydroid spreads NMEA sentences with the same time
                a, b = a[:1], b[:1]
            wrong += [f"{t['name']}: stamps {a}, the judge has {b}"] * (not np.allclose(a, b, 0, 0.02))
        for f in t["fields"]:
            name = f["column"].removeprefix(t["name"]).lstrip(".")
            if name in columns:
                x = np.asarray(columns[name], float)
                finite, fields = x[np.isfinite(x)], fields + 1
                a, b = (f["low"], f["high"]), (finite.min(), finite.max()) if len(finite) else (None, None)
                same = all(p == q or None not in (p, q) and abs(p - q) <= 2e-6 * max(1, abs(p), abs(q)) for p, q in zip(a, b))
                if not same or f["missing"] != len(x) - len(finite):
                    wrong.append(f"{f['column']}: {a}, {f['missing']} missing; the judge has {b}, {len(x) - len(finite)} missing")
    return fields, stamps, wrong

def main():
    warnings.filterwarnings("ignore")
    folder, bad = Path(os.environ["HYDROID_DATA"]), 0
    folder = folder / "wild" if (folder / "wild").is_dir() else folder
    for name in sys.argv[1:] or EXPECTED:
        want, topics = EXPECTED[name], {}
        run = subprocess.run([*os.environ.get("HYDROID_COMMAND", "hydroid").split(), "inspect", "--json", folder / name], capture_output=True)
        found = json.loads(run.stdout)
        found = found[0] if isinstance(found, list) else found  # a recording with one topic is also shown as a table
        if isinstance(want, str) or "error" in found:
            text = found.get("error", "no error")
            wrong, said = [text] * (not isinstance(want, str) or want not in text), f"refused, {want}"
        else:
            globals()[want[0]](folder / name, topics)
            fields, stamps, wrong = compare(found, topics)
            got = (want[0], len(found["topics"]), sum(t["rows"] for t in found["topics"]), fields)
            wrong += [f"expected {want}"] * (got != want)
            said = f"{got[1]} topics, {got[2]} rows; compared with {got[0]}: {fields} fields, stamps of {stamps} topics"
        print(f"{name}: {said}; {len(wrong)} contradictions", *wrong[:8], sep="\n    ")
        bad += bool(wrong)
    return f"{bad} files with contradictions" if bad else 0

if __name__ == "__main__":
    sys.exit(main())
