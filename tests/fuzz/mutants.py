"""Damage done to files: bits, bytes, numbers, lines and trees of JSON, the same for equal seeds."""

import json
import re

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
VALUE = re.compile(rb'"(?:[^"\\\n]|\\.)*"|\b(?:true|false|null)\b|-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?')
NUMBERS = (
    b"0", b"-0", b"-1", b"1", b"nan", b"-inf", b"1e999", b"-1e308", b"1e-320", b"1e300", b"65536",
    b"2147483648", b"-9223372036854775809", b"18446744073709551616", b"9" * 400, b"1_0",
    "１２".encode(), b"0x10", b"1e", b".", b"", b"3.5", b"255", b"0.1", b"9" * 5000,
)  # fmt: skip
LITERALS = (
    b'""', b'"\\u0000"', b'"\\u001b[2J"', b'"\\ud800"', b"null", b"true", b"[]", b"{}", b"[[]]",
    b'"../../etc/passwd"', b'"' + b"x" * 3000 + b'"', b"[" * 2000, b'{"a":' * 500, b"NaN",
    b"Infinity", b'"nan"', b"'", b'"\xff\xfe"', b"[1, 2, 3]", b"{ a = 1 }", b"1979-05-27",
)  # fmt: skip
PIECES = (
    b"\0", b"\r", b"\n", b"\n\n", b"\x1b[2J", b"\xff", b"\xef\xbb\xbf", b"{", b"}", b"<", b">",
    b"&", b'"', b",", b";", b"\t", b"#", b":", "\u202e".encode(), b"\xed\xa0\x80", b" " * 3000,
    b"-->", b"\\", b"=", b"@", b"e", b"-", b".", b"[", b"]",
)  # fmt: skip
FIELDS = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
WIDE = (*FIELDS, 1 << 40, (1 << 62) + 1, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)
NODES = (
    None, True, False, 0, -1, 1, 2, 0.5, 1e308, -1e-320, 2**31, 2**53, 2**63, 2**64, 10**40, "",
    10**400, "x", "\0", "\x1b[2J", "\ud800", "\u202e", "../../etc/passwd", "x" * 3000, [], {}, [[]],
    [None], [0], [-1, 0], [1, 2, 3], {"a": 1}, [[[[[[]]]]]], "nan", "0" * 64, 1e-9, 100.0,
)  # fmt: skip


def damaged(data, others, rng):
    """Bytes with one to three kinds of damage; `others` are further files of the same kind."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        rng.choice(WAYS)(data, others, rng)
    return bytes(data)


def flip(data, others, rng):
    for _ in range(rng.choice((1, 1, 2, 8))):
        if data:
            data[somewhere(data, rng)] ^= 1 << rng.randrange(8)


def write_field(data, others, rng):
    """Overwrite what may be a binary number."""
    size = rng.choice((1, 2, 2, 4, 4, 8))
    at = somewhere(data, rng) // size * size
    values = WIDE if size == 8 else FIELDS
    value = rng.choice(values) & ((1 << 8 * size) - 1)
    data[at : at + size] = value.to_bytes(size, rng.choice(("little", "little", "big")))


def write_number(data, others, rng):
    replace_match(data, NUMBER, NUMBERS, rng)


def write_value(data, others, rng):
    replace_match(data, VALUE, LITERALS, rng)


def replace_match(data, pattern, choices, rng):
    found = list(pattern.finditer(bytes(data[:200_000])))
    if found:
        start, end = rng.choice(found[:40] if rng.random() < 0.5 else found).span()
        data[start:end] = rng.choice(choices)


def delete(data, others, rng):
    at = somewhere(data, rng)
    del data[at : at + rng.choice((1, 1, 2, 8, 100, 1000))]


def insert(data, others, rng):
    at = somewhere(data, rng)
    data[at:at] = rng.choice(PIECES) * rng.choice((1, 1, 1, 2, 40))


def double(data, others, rng):
    at, to = somewhere(data, rng), somewhere(data, rng)
    data[to:to] = data[at : at + rng.choice((1, 4, 60, 500))]


def cut(data, others, rng):
    del data[rng.randrange(len(data) + 1) :]


def splice(data, others, rng):
    other = rng.choice(others)
    data[rng.randrange(len(data) + 1) :] = other[rng.randrange(len(other) + 1) :]


def change_lines(data, others, rng):
    lines = bytes(data).split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.randrange(3)
    if way == 0:
        del lines[i]
    elif way == 1:
        lines.insert(i, lines[j])
    else:
        lines[i], lines[j] = lines[j], lines[i]
    data[:] = b"\n".join(lines)


WAYS = (
    flip, write_field, write_number, write_number, write_value, delete, insert, double, cut, splice,
    change_lines,
)  # fmt: skip


def somewhere(data, rng):
    """A place in the bytes, every second time near their beginning, where headers are."""
    end = max(len(data), 1)
    return rng.randrange(min(end, 600) if rng.random() < 0.5 else end)


def changed_tree(tree, rng):
    """A tree of JSON with one to three nodes changed, dropped, doubled or moved."""
    tree = copied(tree)
    for _ in range(rng.choice((1, 1, 2, 3))):
        places = list(nodes_of(tree))
        if not places:
            return tree
        holder, key = rng.choice(places[:60] if rng.random() < 0.5 else places)
        way = rng.random()
        if way < 0.6:
            value = holder[key]
            is_number = type(value) in (int, float) and rng.random() < 0.5
            holder[key] = nudged(value, rng) if is_number else copied(rng.choice(NODES))
        elif way < 0.75:
            del holder[key]
        elif way < 0.9:
            other, theirs = rng.choice(places)
            holder[key] = copied(other[theirs]) if usable(other, theirs) else None
        elif type(holder) is list:
            holder.append(copied(holder[key]))
        else:
            holder[str(rng.choice(NODES))] = copied(holder[key])
    return tree


def copied(tree):
    return json.loads(json.dumps(tree))


def nudged(value, rng):
    as_float = float(value) if abs(value) < 1e300 else 0.5
    return rng.choice((value + 1, value - 1, -value, value * 2, as_float, value * 1000))


def usable(holder, key):
    return 0 <= key < len(holder) if type(holder) is list else key in holder


def nodes_of(tree):
    """Every place in a tree: what holds it, and its key there."""
    entries = tree.items() if type(tree) is dict else enumerate(tree)
    for key, value in list(entries):
        yield tree, key
        if type(value) in (dict, list):
            yield from nodes_of(value)


def damaged_json(data, others, rng):
    """JSON, or a line of JSON lines, with its tree changed; as text every third time."""
    if rng.random() < 0.33:
        return damaged(data, others, rng)
    lines = data.decode("utf-8", "surrogateescape").split("\n")
    try:
        return json.dumps(changed_tree(json.loads("\n".join(lines)), rng)).encode()
    except ValueError:
        at = rng.randrange(max(len(lines) - 1, 1))
        lines[at] = json.dumps(changed_tree(json.loads(lines[at]), rng))
        return "\n".join(lines).encode("utf-8", "surrogateescape")
