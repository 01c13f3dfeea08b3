// What the page shows: decoded when it is first looked at, forgotten when others were since.
// All scripts of this folder are read as one, in the order that html.py names.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const JOINT = Object.fromEntries(data.joints.map((name, number) => [name, number]));
const UNKNOWN = -32768;
const NO_COST = 65535;
const MOST_DECODED = 60;
const decoded = new Map();

function bytesOf(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i += 1) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

/** Poses and feature words of a piece; those that were used last are kept. */
function decode(piece) {
  let found = decoded.get(piece);
  if (found) decoded.delete(piece);
  else found = { poses: new Int16Array(bytesOf(piece.poses).buffer), words: bytesOf(piece.words) };
  decoded.set(piece, found);
  if (decoded.size > MOST_DECODED) decoded.delete(decoded.keys().next().value);
  return found;
}

/** Joint positions in metres at a frame of the document, which may lie between two. */
function poseAt(piece, frame, pose = new Float32Array(3 * data.joints.length)) {
  const { poses } = decode(piece);
  const count = poses.length / pose.length;
  const place = Math.min(Math.max((frame - piece.start) / piece.step, 0), count - 1);
  const first = Math.floor(place);
  const share = place - first;
  const here = first * pose.length;
  const next = Math.min(first + 1, count - 1) * pose.length;
  for (let i = 0; i < pose.length; i += 1) {
    const [a, b] = [poses[here + i], poses[next + i]];
    pose[i] = a === UNKNOWN || b === UNKNOWN
      ? NaN
      : (piece.origin[i % 3] + piece.unit * (a + share * (b - a))) / 1000;
  }
  return pose;
}

/** Tells of a piece whether a feature holds at a frame of the document. */
function featuresOf(piece) {
  const width = Math.ceil(data.features.length / 8);
  const { words } = decode(piece);
  return (frame, feature) => (words[(frame - piece.start) * width + (feature >> 3)] >> (feature & 7)) & 1;
}

/** The angle about the vertical, from Z to X, in which a pose faces. */
function facing(pose) {
  const [left, right] = [3 * JOINT.lhip, 3 * JOINT.rhip];
  const angle = Math.atan2(pose[right + 2] - pose[left + 2], pose[left] - pose[right]);
  return Number.isFinite(angle) ? angle : 0;
}

/** A stretch to be played: frames [start, end) of a piece, and the body that moves there. */
function makeClip(piece, start, end, body) {
  const pose = poseAt(piece, start);
  const top = topOf(piece, start, end) - body.floor;
  return { piece, start, end, top, size: body.size, floor: body.floor, facing: facing(pose) };
}

/** How high the highest joint comes, in metres; looked at a hundred times at most. */
function topOf(piece, start, end) {
  const pose = new Float32Array(3 * data.joints.length);
  let top = -Infinity;
  for (let frame = start; frame < end; frame += Math.max(1, (end - start) / 100)) {
    poseAt(piece, frame, pose);
    for (let i = 1; i < pose.length; i += 3) if (pose[i] > top) top = pose[i];
  }
  return top;
}

function pieceOf(hit) {
  const { pieces } = data.documents[hit.document];
  return pieces.find((piece) => piece.start <= hit.start && hit.start < piece.start + piece.frames);
}

function hitClip(hit) {
  hit.clip ??= makeClip(pieceOf(hit), hit.start, hit.end, data.documents[hit.document]);
  return hit.clip;
}

/** All that the page holds around a hit; the whole take, as a rule. */
function takeClip(hit) {
  const piece = pieceOf(hit);
  const clip = hitClip(hit);
  return { ...clip, start: piece.start, end: piece.start + piece.frames };
}

function referenceClip(hit) {
  if (hit.reference === null) return null;
  const reference = data.references[hit.reference];
  if (reference.hit !== null) return hitClip(data.hits[reference.hit]);
  const { piece } = reference;
  reference.clip ??= makeClip(piece, piece.start, piece.start + piece.frames, reference);
  return reference.clip;
}

/** The frame of the reference that goes with a frame of the hit's document. */
function referenceFrame(hit, frame) {
  const clip = referenceClip(hit);
  const since = Math.max(frame - hit.start, 0);
  if (!hit.steps.length) return clip.start + (since % (clip.end - clip.start));
  const first = Math.min(Math.floor(since), hit.steps.length - 1);
  const next = Math.min(first + 1, hit.steps.length - 1);
  const share = Math.min(since - first, 1);
  return clip.start + hit.steps[first] + share * (hit.steps[next] - hit.steps[first]);
}

/** The costs of a distance function, NaN where no match can end. */
function costsOf(curve) {
  const values = () => new Uint16Array(bytesOf(curve.costs).buffer);
  curve.decoded ??= Float32Array.from(values(), (cost) => (cost === NO_COST ? NaN : cost / 10000));
  return curve.decoded;
}

function seconds(frames) {
  return (frames / data.rate).toFixed(2);
}
