"""Files that an enemy made: damaged within, with digests that are right for what they hold."""

import hashlib
import io
import json
import struct
import zipfile
from dataclasses import replace

from mocapidx.index.postings import DIGEST_SIZE, ENTRY, HEADER, MAGIC, PART
from mocapidx.store import schema
from mocapidx.store.encoding import encode_manifest
from mocapidx.store.manifest import FileRecord, block_digest, file_digest
from mocapidx.store.read import read_manifest
from mocapidx.store.sealed import SEAL
from tests.fuzz.mutants import changed_tree, damaged

STEP = 2_654_435_761  # a prime, so that neighbouring numbers flip bits far from each other


def digested(body):
    """A manifest or a measured sigma: the digest of the rest, then the rest."""
    return file_digest(body).hexdigest().encode() + b"\n" + body


def forged_lines(data, others, rng):
    """A manifest or a sigma of another content."""
    body = data.partition(b"\n")[2]
    if rng.random() < 0.2:
        return digested(damaged(body, [body], rng))
    return digested(json.dumps(changed_tree(json.loads(body), rng)).encode())


def forged_seal(data, others, rng):
    """A sealed file whose arrays, meta or table were changed."""
    size, _, magic = SEAL.unpack_from(data, len(data) - SEAL.size)
    end = len(data) - SEAL.size
    image, text = data[: end - size], data[end - size : end]
    table = json.loads(text)
    way = rng.random()
    if way < 0.35:
        table = changed_tree(table, rng)
    elif way < 0.7:
        image, table = with_meta(image, table, rng)
    else:
        image = bytearray(image)
        entry = rng.choice([each for name, each in table["datasets"].items() if name != "meta"])
        at = entry["offset"] + 8 * rng.randrange(max(product(entry["shape"]), 1))
        image[at : at + 8] = odd_number(entry["dtype"], rng)
        image = bytes(image)
    text = json.dumps(table).encode() if rng.random() < 0.97 else damaged(text, [text], rng)
    body = image + text + struct.pack("<Q", len(text))
    return body + file_digest(body).digest() + magic


def product(shape):
    found = 1
    for length in shape:
        found *= length
    return found


def odd_number(dtype, rng):
    odd = (0.0, -1.0, 1e308, -1e308, float("nan"), float("inf"), 1e-320, 0.5, 2.0, 1e9)
    if "f" in dtype:
        return struct.pack("<d", rng.choice(odd))
    return struct.pack("<q", rng.choice((0, -1, 1, 7, 2**31, 2**62, -(2**63), 2**63 - 1)))


def with_meta(image, table, rng):
    """Change what a sealed file says of its arrays; the new text lies behind the old image."""
    entry = table["datasets"]["meta"]
    start = entry["offset"]
    meta = json.loads(image[start : start + entry["shape"][0]])
    text = json.dumps(changed_tree(meta, rng)).encode()
    entry.update(offset=len(image), shape=[len(text)])
    return image + text, table


def forged_archive(data, others, rng):
    """An npz with a damaged member and right checksums, or with damage all over."""
    if rng.random() < 0.25:
        return damaged(data, others, rng)
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        members = [(name, file.read(name)) for name in file.namelist()]
    at = rng.randrange(len(members))
    name, content = members[at]
    way = rng.random()
    if way < 0.8:
        members[at] = (name, damaged(content[:256], [content], rng) + content[256:])
    elif way < 0.87:
        del members[at]
    elif way < 0.94:
        members[at] = (rng.choice(members)[0], content)
    else:
        members[at] = (name, rng.choice(members)[1])
    stream = io.BytesIO()
    method = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(stream, "w", method) as file:
        for name, content in dict(members).items():
            file.writestr(name, content)
    return stream.getvalue()


def files_of(store):
    """List the files of a store, but for its lock."""
    return [path for path in sorted(store.rglob("*")) if path.is_file() and path.name != "LOCK"]


def flip_bit(store, rng, number):
    """Flip one bit of a store; so many numbers as there are bits flip each of them once."""
    files = files_of(store)
    sizes = [path.stat().st_size for path in files]
    place, bit = divmod(number * STEP % (8 * sum(sizes)), 8)
    for path, size in zip(files, sizes, strict=True):
        if place < size:
            data = bytearray(path.read_bytes())
            data[place] ^= 1 << bit
            path.write_bytes(data)
            return
        place -= size


def forge_index(store, rng, number):
    """Damage an index of a store and give all digests above the damage again."""
    manifest = read_manifest(store)
    number = rng.randrange(len(manifest.files))
    file = manifest.files[number]
    path = store / schema.SEGMENTS / file.names[1]
    data, head_size = path.read_bytes(), file.head.size
    way = rng.random()
    if way < 0.3:
        data = damaged(data, [data], rng)
    elif way < 0.6:
        head = damaged(data[:head_size], [data], rng)
        data, head_size = head + data[head_size:], len(head)
    else:
        data = with_damaged_list(data, rng)
        head_size = HEADER.unpack_from(data, len(MAGIC))[0]
    head_size = min(head_size, len(data))
    path.write_bytes(data)
    forged = replace(
        file,
        idx=FileRecord(len(data), file_digest(data).hexdigest()),
        head=FileRecord(head_size, file_digest(data[:head_size]).hexdigest()),
    )
    rewrite(store, manifest, number, forged)


def with_damaged_list(data, rng):
    """Damage one list; the directory has its new size and digest."""
    head_size, parts = HEADER.unpack_from(data, len(MAGIC))
    place, entries = len(MAGIC) + HEADER.size, []
    for _ in range(parts):
        _, _, count = PART.unpack_from(data, place)
        place += PART.size
        entries += [place + n * ENTRY.itemsize for n in range(count)]
        place += count * ENTRY.itemsize
    chosen = rng.randrange(len(entries))
    sizes = [struct.unpack_from("<I", data, at + 8)[0] for at in entries]
    # long lists are bitmaps, which are worth more damage than plain numbers
    if rng.random() < 0.7:
        chosen = max(range(len(sizes)), key=lambda n: (sizes[n] > 28, rng.random()))
    start = head_size + sum(sizes[:chosen])
    blob = damaged(data[start : start + sizes[chosen]], [data[head_size:]], rng)
    entry = bytearray(data[entries[chosen] : entries[chosen] + ENTRY.itemsize])
    entry[8:12] = struct.pack("<I", len(blob))
    entry[12 : 12 + DIGEST_SIZE] = hashlib.blake2b(blob, digest_size=DIGEST_SIZE).digest()
    if rng.random() < 0.2:
        entry[4:8] = struct.pack("<I", rng.choice((0, 1, 7, 8, 100, 2**32 - 1)))
    at = entries[chosen]
    head = data[:at] + bytes(entry) + data[at + len(entry) : head_size]
    return head + data[head_size:start] + blob + data[start + sizes[chosen] :]


def forge_arrays(store, rng, number):
    """Damage the data of an HDF5 file and give all digests above the damage again."""
    manifest = read_manifest(store)
    number = rng.randrange(len(manifest.files))
    file = manifest.files[number]
    path = store / schema.SEGMENTS / file.names[0]
    data = bytearray(path.read_bytes())
    name = rng.choice(sorted(file.datasets))
    dataset = file.datasets[name]
    column = schema.column(name)
    size = dataset.shape[0] * column.row_bytes
    begin = dataset.offset
    if rng.random() < 0.25:
        begin, size = 0, len(data)  # what HDF5 itself reads
    for _ in range(rng.choice((1, 2, 20))):
        at = begin + rng.randrange(size) // 4 * 4
        values = (0, 1, 0xFFFFFFFF, 0x7F800000, 0x7FC00000, 0x7F7FFFFF, 0x80000000)
        data[at : at + 4] = rng.choice(values).to_bytes(4, "little")[: len(data) - at]
    path.write_bytes(data)
    forge_digests(store, manifest, number, data)


def forge_digests(store, manifest, number, data):
    """Give the bytes of an HDF5 file right digests in the manifest."""
    file = manifest.files[number]
    forged = replace(
        file,
        h5=FileRecord(len(data), file_digest(data).hexdigest()),
        datasets={
            key: replace(each, blocks=blocks_of(data, each, schema.column(key).row_bytes))
            for key, each in file.datasets.items()
        },
    )
    rewrite(store, manifest, number, forged)


def blocks_of(data, dataset, row_bytes):
    end = dataset.offset + dataset.shape[0] * row_bytes
    starts = range(dataset.offset, end, schema.BLOCK)
    return "".join(block_digest(bytes(data[at : min(at + schema.BLOCK, end)])) for at in starts)


def rewrite(store, manifest, number, forged):
    files = [*manifest.files[:number], forged, *manifest.files[number + 1 :]]
    (store / schema.MANIFEST).write_bytes(encode_manifest(replace(manifest, files=tuple(files))))


def tree_of(store):
    return json.loads((store / "MANIFEST").read_bytes().partition(b"\n")[2])


def with_tree(change):
    """A change of the JSON of a manifest, which gets a right digest."""

    def apply(store):
        tree = tree_of(store)
        change(tree)
        (store / "MANIFEST").write_bytes(digested(json.dumps(tree).encode()))

    return apply


def with_index(change):
    """A change of the bytes of an index, which gets right digests and sizes."""

    def apply(store):
        manifest = read_manifest(store)
        file = manifest.files[0]
        path = store / "segments" / file.names[1]
        data, head_size = change(path.read_bytes(), file.head.size)
        path.write_bytes(data)
        forged = replace(
            file,
            idx=FileRecord(len(data), file_digest(data).hexdigest()),
            head=FileRecord(head_size, file_digest(data[:head_size]).hexdigest()),
        )
        rewrite(store, manifest, 0, forged)

    return apply
