"""Valid files of each motion format, written any way their grammar allows, and what they say."""

import io
import json
import zipfile

import numpy as np

from tests.made_points import c3d_bytes

__all__ = ["GRAMMARS"]

LETTERS = ("hip", "Left Arm", "knee_2", "a:b", "Kopf", "ü", "関節", "x" * 40, "end", "joint", "1")
KINDS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
DOFS = ("TX", "TY", "TZ", "RX", "RY", "RZ")


def spelled(value, rng):
    """A number as some program writes it, and the number that this is."""
    way = rng.randrange(8)
    text = (
        repr(value), f"{value:.6f}", f"{value:e}", f"{value:.3G}", f"{value:+.2f}", f"{value:.0f}.",
        f"{value:012.5f}", str(round(value)),
    )[way]  # fmt: skip
    return text, float(text)


def numbers(count, rng, scale=100.0):
    pairs = [spelled(rng.gauss(0, scale), rng) for _ in range(count)]
    return [text for text, _ in pairs], [value for _, value in pairs]


def names(count, rng, blanks=True):
    made = []
    for number in range(count):
        name = rng.choice(LETTERS) + (f"{number}" if rng.random() < 0.5 else f"_{number}")
        made.append(name if blanks else name.replace(" ", ""))
    return made


def any_case(word, rng):
    return rng.choice((word, word.upper(), word.lower(), word.capitalize()))


def joined(lines, rng):
    """Lines with the ends, blanks and byte order mark of some program."""
    end = rng.choice(("\n", "\r\n", "\r"))
    indent = rng.choice(("", "  ", "\t"))
    after = rng.choice(("", " ", "\t "))
    text = end.join(indent + line + after for line in lines)
    if rng.random() < 0.8:
        text += end * rng.choice((1, 1, 3))
    mark = b"\xef\xbb\xbf" if rng.random() < 0.2 else b""
    return mark + text.encode()


def bvh(rng):
    """A tree of joints with any channels."""
    count = rng.randint(1, 9)
    parents = [-1] + [rng.randrange(number) for number in range(1, count)]
    called = names(count, rng)
    lines, order, channels, offsets = [any_case("Hierarchy", rng)], [], [], {}

    def visit(node):
        heading = f"{any_case('Joint' if parents[node] >= 0 else 'Root', rng)} {called[node]}"
        brace = rng.random() < 0.3
        lines.extend([f"{heading} {{"] if brace else [heading, "{"])
        words, offset = numbers(3, rng)
        offsets[called[node]] = offset
        order.append(called[node])
        kinds = rng.sample(range(6), rng.randint(1, 6))
        channels.extend((called[node], kind) for kind in kinds)
        both = [
            f"{any_case('Offset', rng)} {rng.choice(('', '  ')).join(('', ' '.join(words)))}",
            f"{any_case('Channels', rng)} {len(kinds)} " + " ".join(KINDS[k] for k in kinds),
        ]
        lines.extend(both if rng.random() < 0.8 else both[::-1])
        children = [other for other in range(count) if parents[other] == node]
        for child in children:
            visit(child)
        if not children and rng.random() < 0.6:
            words, offset = numbers(3, rng)
            order.append(f"{called[node]}/End")
            offsets[order[-1]] = offset
            lines.extend(["End Site", "{", "OFFSET " + "\t".join(words), "}"])
        lines.append("}")

    visit(0)
    frames = rng.randint(1, 6)
    rows = [numbers(len(channels), rng) for _ in range(frames)]
    rate = rng.choice((24, 25, 30, 60, 90, 120, 240))
    time = rng.choice((repr(1 / rate), f"{1 / rate:.6f}", f"{1 / rate:.7e}"))
    lines += ["MOTION", f"Frames: {frames}", f"Frame Time:{rng.choice((' ', chr(9)))}{time}"]
    for words, _ in rows:
        lines.append(rng.choice((" ", "\t", "  ")).join(words))
        lines.extend([""] if rng.random() < 0.1 else [])
    return {"take.bvh": joined(lines, rng)}, {
        "names": order,
        "offsets": offsets,
        "channels": {key: [row[n] for _, row in rows] for n, key in enumerate(channels)},
        "rate": float(rate),
    }


def acclaim(rng):
    """A skeleton in one file, its motion in another; bones in any order in each frame."""
    count = rng.randint(1, 8)
    called = ["root", *names(count, rng, blanks=False)]
    parents = [-1] + [rng.randrange(number) for number in range(1, count + 1)]
    degrees = rng.random() < 0.7
    unit, unit_value = spelled(rng.uniform(0.1, 2.0), rng)
    if unit_value <= 0:
        unit, unit_value = "1", 1.0
    offsets, dofs = {"root": [0.0] * 3}, {"root": rng.sample(range(6), 6)}
    lines = ["# made", ":version 1.10", ":name SMALL", ":units", f"length {unit}"]
    lines += [f"angle {'deg' if degrees else 'rad'}", ":documentation", "any words {here}"]
    lines += [":root", "order " + " ".join(DOFS[k] for k in dofs["root"]), "axis XYZ"]
    lines += ["position 0 0 0", "orientation 0 0 0", ":bonedata"]
    for name in called[1:]:
        words, direction = numbers(3, rng, 1.0)
        length, length_value = spelled(rng.uniform(0, 10), rng)
        offsets[name] = [value * length_value for value in direction]
        dofs[name] = rng.sample((3, 4, 5), rng.randint(0, 3))
        entries = [f"direction {' '.join(words)}", f"length {length}"]
        if rng.random() < 0.7:
            entries.append("axis 0 0 0 XYZ")
        if dofs[name]:
            entries.append("dof " + " ".join(DOFS[k].lower() for k in dofs[name]))
        if rng.random() < 0.5:
            entries += ["limits (-160.0 20.0)", "(-70.0 70.0)"]
        rng.shuffle(entries)
        lines += ["begin", f"id {len(offsets)}", f"name {name}", *entries, "end"]
    lines += [":hierarchy", "begin"]
    for node, name in enumerate(called):
        children = [called[n] for n, parent in enumerate(parents) if parent == node]
        if children:
            lines.append(" ".join([name, *children]))
    lines.append("end")
    moved = [name for name in called if dofs[name]]
    channels = {(name, kind): [] for name in moved for kind in dofs[name]}
    rows = [rng.choice((":DEGREES", ":degrees") if degrees else (":RADIANS",))]
    rate = rng.choice((None, 60.0, 120.0))
    rows += [f":SAMPLES-PER-SECOND {rate:g}"] if rate else []
    rows = ["#!OML:ASF x.asf", ":FULLY-SPECIFIED", *rows]
    for frame in range(rng.randint(1, 5)):
        rows.append(str(frame + 1))
        rng.shuffle(moved)
        for name in moved:
            words, values = numbers(len(dofs[name]), rng)
            rows.append(rng.choice((" ", "\t", "  ")).join([name, *words]))
            for kind, value in zip(dofs[name], values, strict=True):
                channels[name, kind].append(value)
    return {"take.amc": joined(rows, rng), "take.asf": joined(lines, rng)}, {
        "names": called,
        "offsets": offsets,
        "channels": channels,
        "rate": rate,
        "unit": 0.0254 / unit_value,
        "degrees": degrees,
    }


def points(rng, decimals, scale=1.0, gaps=True):
    """Names, and places that so many decimals hold; NaN where nothing was seen."""
    count, frames = rng.randint(1, 7), rng.randint(2, 6)
    made = [f"{'M' if rng.random() < 0.5 else 'Left'}{number}" for number in range(count)]
    random = np.random.default_rng(rng.randrange(1 << 32))
    # No negative zero, which is no number to a DEC.
    places = np.round(random.normal(0, scale, (frames, count, 3)), decimals) + 0.0
    if gaps:
        seen = random.random((frames, count)) < 0.8
        seen[[0, -1]] = True  # a table without the last frame would end before
        places[~seen] = np.nan
    return made, places


def c3d(rng):
    """Any processor, whole or real numbers, with analogue channels or without."""
    real = rng.random() < 0.6
    scale = rng.choice((0.5, 0.125, 1.0))
    made, places = points(rng, 0, 300.0)
    places = places * (1.0 if real else scale)
    unit, metres = rng.choice((("mm", 0.001), ("cm", 0.01), ("m", 1.0)))
    up = rng.choice("xyz")
    processor = rng.choice(("Intel", "DEC", "SGI"))
    data = c3d_bytes(
        made, places, rng.choice((50.0, 100.0, 120.0)), processor=processor,
        real=real, scale=scale, units=unit, up=f"+{up.upper()}", analogue=rng.choice((0, 0, 3)),
    )  # fmt: skip
    return {"take.c3d": data}, {"names": made, "positions": places, "unit": metres}


def trc(rng):
    """Tabs or commas, gaps as blanks or as NaN."""
    made, places = points(rng, 3, 300.0)
    unit, metres = rng.choice((("mm", 0.001), ("m", 1.0)))
    blank = rng.choice(("", " ", "NaN", "nan"))
    rate = rng.choice((30.0, 59.94, 120.0))
    frames, count = places.shape[:2]
    first = rng.choice((0, 1, 7))
    lines = ["PathFileType\t4\t(X/Y/Z)\tmade.trc"]
    lines.append("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate")
    lines.append(f"{rate}\t{rate}\t{frames}\t{count}\t{unit}\t{rate}")
    lines.append("Frame#\tTime\t" + "\t\t\t".join(made) + rng.choice(("", "\t\t")))
    lines.append("\t\t" + "\t".join(f"{a}{i + 1}" for i in range(count) for a in "XYZ"))
    lines.extend([""] if rng.random() < 0.5 else [])
    for frame, row in enumerate(places):
        cells = [blank if np.isnan(v) else repr(v.item()) for v in row.ravel()]
        lines.append("\t".join([str(frame + first), f"{frame / rate:.6f}", *cells]))
    end = rng.choice(("\n", "\r\n", "\r"))
    text = end.join(lines) + end
    text = text.replace("\t", ",") if rng.random() < 0.3 and blank != " " else text
    return {"take.trc": text.encode()}, {
        "names": made,
        "positions": places,
        "rate": rate,
        "unit": metres,
    }


def table(rng):
    """One row a frame, or one a joint and frame."""
    made, places = points(rng, 4)
    mark = rng.choice("._ ")
    rate = None
    if rng.random() < 0.5:
        rate = rng.choice((30.0, 50.0, 100.0))
        lines = [["time", *(f"{name}{mark}{axis}" for name in made for axis in "xyz")]]
        for frame, row in enumerate(places):
            cells = ["" if np.isnan(v) else repr(v.item()) for v in row.ravel()]
            lines.append([repr(frame / rate), *cells])
    else:
        lines = [["frame", "joint", "x", "y", "z"]]
        for frame, row in enumerate(places):
            for name, place in zip(made, row.tolist(), strict=True):
                if not np.isnan(place[0]):
                    lines.append([str(frame), name, *map(repr, place)])
    end = rng.choice(("\n", "\r\n"))
    mark = b"\xef\xbb\xbf" if rng.random() < 0.2 else b""
    text = end.join(map(",".join, lines)) + end
    return {"take.csv": mark + text.encode()}, {"names": made, "positions": places, "rate": rate}


def archive(rng):
    """An npz of positions of any type and layout."""
    made, places = points(rng, 3)
    kind = rng.choice(("f4", "f8", ">f8", ">f4"))
    places = places.astype(kind)
    laid = np.asfortranarray(places) if rng.random() < 0.5 else places
    arrays = {"positions": laid, "joints": np.array(made), "rate": rng.choice((30, 59.94))}
    unit = rng.choice((None, 1.0, 0.001))
    if unit:
        arrays["unit"] = unit
    stream = io.BytesIO()
    (np.savez if rng.random() < 0.5 else np.savez_compressed)(stream, **arrays)
    expected = {"names": made, "positions": places.astype("f8"), "rate": float(arrays["rate"])}
    return {"take.npz": stream.getvalue()}, expected


def array(rng):
    """An npy with the names of its joints beside it."""
    made, places = points(rng, 3)
    places = places.astype(rng.choice(("f4", "f8", ">f8")))
    stream = io.BytesIO()
    np.save(stream, np.asfortranarray(places) if rng.random() < 0.5 else places)
    beside = rng.choice(("\n", "\r\n")).join(made).encode()
    files = {"take.npy": stream.getvalue(), "take.joints.txt": beside}
    return files, {"names": made, "positions": places.astype("f8")}


def keypoints(rng):
    """Frames of points, flat or not, with confidences or without."""
    made, places = points(rng, 4)
    frames = []
    with_confidence = rng.random() < 0.5
    flat = with_confidence and rng.random() < 0.5
    for row in places.tolist():
        seen = [place if place[0] == place[0] else None for place in row]
        if with_confidence:
            seen = [[*place, 0.9] if place else [0.0, 0.0, 0.0, 0.0] for place in seen]
        if flat:
            seen = [value for place in seen for value in place]
        frames.append(seen if rng.random() < 0.5 else {"keypoints": seen})
    whole = {"joints": made, rng.choice(("rate", "fps")): 60, "frames": frames}
    indent = rng.choice((None, 1))
    return {"take.json": json.dumps(whole, indent=indent).encode()}, {
        "names": made,
        "positions": places,
        "rate": 60.0,
    }


def npy(values, rng):
    """An array as some program saves it: any order of axes, any version of the header."""
    laid = np.asfortranarray(values) if rng.random() < 0.3 else values
    stream = io.BytesIO()
    if laid.dtype.hasobject:
        np.save(stream, laid, allow_pickle=True)
    else:
        np.lib.format.write_array(stream, laid, rng.choice(((1, 0), (2, 0))))
    return stream.getvalue()


def turned(vectors):
    """Matrices of axes times angles (..., 3), by the formula of Rodrigues."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    none = np.zeros_like(x)
    cross = np.stack([np.stack(row, -1) for row in ((none, -z, y), (z, none, -x), (-y, x, none))])
    cross = np.moveaxis(cross, 0, -2)
    cross = cross / np.where(angle > 0, angle, 1)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)


def amass(rng):
    """Poses of a body model: any type and order, other things beside them."""
    random = np.random.default_rng(rng.randrange(1 << 32))
    frames, width = rng.randint(1, 6), rng.choice((66, 72, 156, 165))
    types = ("f4", "f8", ">f4", ">f8", "f2")
    poses = random.normal(0, rng.choice((1e-9, 0.3, 2.0, 30.0)), (frames, width))
    poses[random.random(poses.shape) < rng.choice((0, 0.5, 1))] = 0
    poses = poses.astype(rng.choice(types))
    trans = random.normal(0, 2, (frames, 3)).astype(rng.choice(types))
    rate = rng.choice((None, 30, 59.94, 60, 120, 250))
    arrays = {"poses": poses, "trans": trans}
    if rate is not None:
        key = rng.choice(("mocap_framerate", "mocap_frame_rate"))
        kind = rng.choice(("f8", ">f8") if rate % 1 else ("f8", "f4", "i4", ">i8", "u1"))
        arrays[key] = np.array(rng.choice((rate, [rate], [[rate]])), kind)
    extras = {
        "betas": random.normal(size=rng.choice((10, 16))),
        "gender": np.array(rng.choice(("male", b"female", "neutral"))),
        "dmpls": random.normal(size=(frames, 8)),
        "surface_model_type": np.array("smplx"),
        "labels": np.array(["C7", None, {}], object),
        "marker_data": random.normal(size=(frames, 4, 3)),
        "root_orient": random.normal(size=(frames, 3)),
        "mocap_time_length": np.array(frames / 60),
    }
    chosen = rng.sample(sorted(extras), rng.randint(0, len(extras)))
    arrays.update((name, extras[name]) for name in chosen)
    members = list(arrays.items())
    rng.shuffle(members)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        for name, values in members:
            method = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
            file.writestr(f"{name}.npy", npy(values, rng), method)
    vectors = poses[:, :66].astype("f8").reshape(frames, 22, 3)
    return {"take.npz": stream.getvalue()}, {
        "turns": turned(vectors),
        "root": trans.astype("f8"),
        "rate": None if rate is None else float(rate),
        "unit": 1.0,
        "up": "z",
    }


GRAMMARS = {
    "bvh": bvh,
    "amc": acclaim,
    "c3d": c3d,
    "trc": trc,
    "csv": table,
    "npz": archive,
    "npy": array,
    "json": keypoints,
    "amass": amass,
}
