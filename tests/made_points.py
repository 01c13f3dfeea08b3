"""Files of points, written apart from the readers: C3D as its guide has it, TRC, and markers."""

import struct

import numpy as np

BLOCK = 512
CODES = {"Intel": 84, "DEC": 85, "SGI": 86}


def vax_float(number):
    """Four bytes of a DEC float: an IEEE one times four, its halves exchanged."""
    high, low = struct.unpack(">HH", struct.pack(">f", number * 4))
    return struct.pack("<HH", high, low)


class Machine:
    """How a processor writes numbers."""

    def __init__(self, name):
        self.name = name
        self.order = ">" if name == "SGI" else "<"

    def words(self, *numbers):
        return struct.pack(f"{self.order}{len(numbers)}h", *map(signed, numbers))

    def floats(self, numbers):
        if self.name == "DEC":
            return b"".join(vax_float(float(n)) for n in numbers)
        return struct.pack(f"{self.order}{len(numbers)}f", *numbers)


def signed(word):
    return word - 65536 if word > 32767 else word


def parameter(machine, group, name, kind, shape, data):
    body = bytes([kind & 0xFF, len(shape), *shape]) + data + b"\0"
    head = bytes([len(name), group]) + name.encode()
    return head + machine.words(len(body) + 2) + body


def texts(machine, group, name, values):
    width = max(map(len, values), default=1)
    data = b"".join(v.encode().ljust(width) for v in values)
    return parameter(machine, group, name, -1, (width, len(values)), data)


def c3d_bytes(
    names,
    positions,
    rate=100.0,
    *,
    processor="Intel",
    real=True,
    scale=0.1,
    units="mm",
    up="+Z",
    extra=None,
    analogue=0,
    trial=None,
):
    """A C3D file of points (T, P, 3) in file units; NaN is a point that was not seen."""
    machine = Machine(processor)
    frames, points = positions.shape[:2]
    signed_scale = -scale if real else scale
    group = [bytes([5, 255]) + b"POINT" + machine.words(3) + b"\0"]  # -1: the group's number
    group += [
        parameter(machine, 1, "USED", 2, (), machine.words(points)),
        parameter(machine, 1, "FRAMES", 2, (), machine.words(min(frames, 65535))),
        parameter(machine, 1, "SCALE", 4, (), machine.floats([signed_scale])),
        parameter(machine, 1, "RATE", 4, (), machine.floats([rate])),
        texts(machine, 1, "UNITS", [units]),
        texts(machine, 1, "X_SCREEN", ["+X"]),
        texts(machine, 1, "Y_SCREEN", [up]),
    ]
    for part in range(0, len(names), 255):
        number = part // 255 + 1
        some = names[part : part + 255]
        group.append(texts(machine, 1, "LABELS" + (str(number) if number > 1 else ""), some))
    group += [texts(machine, 1, name, values) for name, values in (extra or {}).items()]
    if trial:
        group.append(bytes([5, 254]) + b"TRIAL" + machine.words(3) + b"\0")
        for name, two in trial.items():
            group.append(parameter(machine, 2, name, 2, (2,), machine.words(*two)))
    records = b"\0\0" + bytes([0, CODES[processor]]) + b"".join(group) + b"\0\0"
    blocks = -(-len(records) // BLOCK)
    records = records.ljust(blocks * BLOCK, b"\0")
    records = records[:2] + bytes([min(blocks, 255)]) + records[3:]
    start = 2 + blocks
    header = bytes([2, 0x50]) + machine.words(points, analogue, 1, min(frames, 65535), 10)
    header += machine.floats([signed_scale]) + machine.words(start, 1 if analogue else 0)
    header += machine.floats([rate])
    seen = np.isfinite(positions).all(axis=2)
    where = np.where(seen[..., None], positions, 0.0)
    if real:
        table = np.concatenate((where, np.where(seen, 0.0, -1.0)[..., None]), axis=2)
        flat = np.zeros((frames, points * 4 + analogue))
        flat[:, : points * 4] = table.reshape(frames, -1)
        data = machine.floats(flat.ravel().tolist())
    else:
        steps = np.rint(where / scale).astype(int)
        table = np.concatenate((steps, np.where(seen, 0, -1)[..., None]), axis=2)
        flat = np.zeros((frames, points * 4 + analogue), dtype=int)
        flat[:, : points * 4] = table.reshape(frames, -1)
        data = machine.words(*flat.ravel().tolist())
    size = -(-len(data) // BLOCK) * BLOCK
    return header.ljust(BLOCK, b"\0") + records + data.ljust(size, b"\0")


def trc_text(names, positions, rate=100.0, units="mm", newline="\n", blank=""):
    """A TRC file of points (T, P, 3); NaN becomes `blank`."""
    frames, points = positions.shape[:2]
    lines = ["PathFileType\t4\t(X/Y/Z)\tmade.trc"]
    lines.append("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate")
    lines.append(f"{rate:.2f}\t{rate:.2f}\t{frames}\t{points}\t{units}\t{rate:.2f}")
    lines.append("Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t")
    lines.append("\t\t" + "\t".join(f"{a}{i + 1}" for i in range(points) for a in "XYZ"))
    lines.append("")
    for frame, row in enumerate(positions):
        cells = [blank if np.isnan(v) else f"{v:.6f}" for v in row.ravel()]
        lines.append(f"{frame + 1}\t{frame / rate:.6f}\t" + "\t".join(cells))
    return newline.join(lines) + newline


def markers_of(joints, positions):
    """Markers of the HDM05 set whose formulas give back the joints, the root nearly so.

    `positions` (T, 24, 3) by the names in `joints`; returns names and (T, M, 3).
    """
    at = {name: positions[:, i] for i, name in enumerate(joints)}
    ahead = np.cross(at["lhip"] - at["rhip"], [0.0, 1.0, 0.0])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    c7 = at["neck"]
    both = 3 * at["chest"] - c7  # STRN and T10 together
    ring = 2 * at["head"] - c7
    markers = {"C7": c7, "STRN": both / 2 + 0.1 * ahead, "T10": both / 2 - 0.1 * ahead}
    for side, sign in (("l", 1), ("r", -1)):
        big = side.upper()
        hip, toes = at[f"{side}hip"], at[f"{side}toes"]
        across = 0.05 * sign * (at["lhip"] - at["rhip"])
        markers[f"{big}FWT"], markers[f"{big}BWT"] = hip + 0.1 * ahead, hip - 0.1 * ahead
        markers[f"{big}KNE"], markers[f"{big}ANK"] = at[f"{side}knee"], at[f"{side}ankle"]
        markers[f"{big}TOE"] = markers[f"{big}MT5"] = toes
        markers[f"{big}FHD"], markers[f"{big}BHD"] = ring + 0.1 * ahead, ring - 0.1 * ahead
        markers[f"{big}SHO"], markers[f"{big}ELB"] = at[f"{side}shoulder"], at[f"{side}elbow"]
        markers[f"{big}WRA"] = at[f"{side}wrist"] + across
        markers[f"{big}WRB"] = at[f"{side}wrist"] - across
        markers[f"{big}FIN"] = at[f"{side}fingers"]
    return list(markers), np.stack(list(markers.values()), axis=1)
