"""Writes recordings in the layouts of other systems; shares nothing with their readers."""

import struct

import numpy as np


def _cell(value, digits=4):
    return "" if np.isnan(value) else f"{value:.{digits}f}"


def upright(tracks):
    """Ground-plane tracks (T, N, 2) in metres as X, Y, Z with Z up, in millimetres."""
    return 1e3 * np.concatenate([tracks, 0.03 + 0 * tracks[..., :1]], axis=2)


def qualisys(tracks, rate, names):
    lines = [f"NO_OF_FRAMES\t{len(tracks)}", "NO_OF_CAMERAS\t8", f"NO_OF_MARKERS\t{len(names)}"]
    lines += [f"FREQUENCY\t{rate:g}", "DESCRIPTION\t--", "DATA_INCLUDED\t3D"]
    lines += [
        "\t".join(["MARKER_NAMES", *names]),
        "\t".join(["TRAJECTORY_TYPES", *["Measured"] * len(names)]),
    ]
    lines.append("\t".join(["Frame", "Time", *(f"{n} {a}" for n in names for a in "XYZ")]))
    for k, row in enumerate(upright(tracks).reshape(len(tracks), -1)):
        lines.append("\t".join([str(k + 1), f"{k / rate:.5f}", *(_cell(v) or "0.0000" for v in row)]))
    return "\r\n".join(lines) + "\r\n"


def vicon(tracks, rate, names):
    lines = ["Devices", "1000", ",,Force", "Frame,Sub Frame,Fx", ",,N", "1,0,0.1", "1,1,0.2", ""]
    lines += ["Trajectories", f"{rate:g}", ",," + ",,,".join(f"snake:{n}" for n in names)]
    lines += ["Frame,Sub Frame," + ",".join(["X", "Y", "Z"] * len(names))]
    lines += [",," + ",".join(["mm"] * 3 * len(names))]
    for k, row in enumerate(upright(tracks).reshape(len(tracks), -1)):
        lines.append(",".join([str(k + 1), "0", *(_cell(v) for v in row)]))
    return "\ufeff" + "\n".join(lines) + "\n"


def trc(tracks, rate, names):
    lines = ["PathFileType\t4\t(X/Y/Z)\ttake.trc"]
    lines.append("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate")
    lines.append(f"{rate:g}\t{rate:g}\t{len(tracks)}\t{len(names)}\tmm\t{rate:g}")
    lines.append("Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t")
    lines.append("\t\t" + "\t".join(f"{a}{i + 1}" for i in range(len(names)) for a in "XYZ"))
    lines.append("")
    for k, row in enumerate(upright(tracks).reshape(len(tracks), -1)):
        lines.append("\t".join([str(k + 1), f"{k / rate:.6f}", *(_cell(v) for v in row)]))
    return "\n".join(lines) + "\n"


def deeplabcut(tracks, names, pixels_per_m=900.0):
    """Pixels from the upper left corner, y down; a lost marker is a wild guess of low likelihood."""
    lines = [",".join(["scorer", *["net"] * 3 * len(names)])]
    lines.append(",".join(["bodyparts", *(n for n in names for _ in range(3))]))
    lines.append(",".join(["coords", *["x", "y", "likelihood"] * len(names)]))
    for k, frame in enumerate(tracks):
        cells = [str(k)]
        for x, y in frame:
            lost = np.isnan(x)
            place = (17.0, 11.0) if lost else (320 + pixels_per_m * x, 240 - pixels_per_m * y)
            cells += [f"{place[0]:.3f}", f"{place[1]:.3f}", "0.05" if lost else "0.99"]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def plain(tracks, rate, names):
    """Semicolons, decimal commas, milliseconds from before the trigger, millimetres, and an angle."""
    heads = ["t [ms]", *(f"{n} {a} [mm]" for n in names for a in "xy"), "quat w"]
    lines = [";".join(heads)]
    for k, row in enumerate(1e3 * tracks.reshape(len(tracks), -1)):
        cells = [f"{1e3 * k / rate - 500:.2f}", *(_cell(v) for v in row), "1.0"]
        lines.append(";".join(cells).replace(".", ","))
    return "\n".join(lines) + "\n"


def motive_rows(tracks, rate, ids):
    lines = ['comment,"OptiTrack Export Data"', "righthanded", "info,version,1.1"]
    for k, frame in enumerate(tracks):
        seen = [(i, p) for i, p in zip(ids, frame) if not np.isnan(p[0])]
        cells = ["frame", str(k), f"{k / rate:.8f}", "1", "1", *["0.1"] * 10, str(len(seen))]
        for i, (x, y) in seen:
            cells += [f"{x:.8f}", "0.05", f"{-y:.8f}", str(i), f"Marker-{i}"]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def c3d(tracks, rate, names):
    """A C3D file of Intel byte order, positions as floats."""
    points = upright(tracks)
    count, frames = points.shape[1], len(points)

    def parameter(group, name, kind, dimensions, data):
        head = struct.pack("<bb", len(name), group) + name.encode()
        body = struct.pack("<bB", kind, len(dimensions)) + bytes(dimensions) + data + b"\x00"
        return head + struct.pack("<H", len(body) + 2) + body

    def group(number, name):
        return struct.pack("<bb", len(name), -number) + name.encode() + struct.pack("<HB", 3, 0)

    labels = "".join(n.ljust(8) for n in names).encode()
    block = group(1, "POINT")
    block += parameter(1, "USED", 2, [], struct.pack("<H", count))
    block += parameter(1, "FRAMES", 2, [], struct.pack("<H", frames))
    block += parameter(1, "SCALE", 4, [], struct.pack("<f", -1.0))
    block += parameter(1, "RATE", 4, [], struct.pack("<f", rate))
    block += parameter(1, "DATA_START", 2, [], struct.pack("<H", 4))
    block += parameter(1, "UNITS", -1, [2], b"mm")
    block += parameter(1, "LABELS", -1, [8, count], labels)
    block += group(2, "ANALOG") + parameter(2, "USED", 2, [], struct.pack("<H", 0))
    block += struct.pack("<bb", 0, 0)
    parameters = (struct.pack("<BBBB", 1, 0x50, 2, 84) + block).ljust(1024, b"\x00")
    header = struct.pack("<BBHHHHHfHHf", 2, 0x50, count, 0, 1, frames, 0, -1.0, 4, 0, rate).ljust(
        512, b"\x00"
    )
    rows = np.concatenate([np.nan_to_num(points), np.where(np.isnan(points[..., :1]), -1.0, 0.0)], axis=2)
    return header + parameters + rows.astype("<f4").tobytes()
