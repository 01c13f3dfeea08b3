// Charts over time, drawn once for each look and size; a line above them moves.

/** Make a canvas as sharp as the screen; returns its context in CSS pixels, and its size. */
function sharp(canvas, height) {
  const width = canvas.clientWidth || 1;
  const ratio = Math.min(devicePixelRatio || 1, 2);
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.height = `${height}px`;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

/** Features as rows, dark where they hold; hatched in another colour where nobody can tell. */
function drawStripes(canvas, clip, unknown, row) {
  const { pen, width, height } = sharp(canvas, row * data.features.length);
  const frames = clip.end - clip.start;
  const holds = featuresOf(clip.piece);
  const mask = BigInt(`0x${unknown}`);
  const line = row > 2 ? 1 : 0;
  data.features.forEach((feature, number) => {
    const y = number * row;
    if ((mask >> BigInt(number)) & 1n) {
      pen.fillStyle = colour("unknown");
      pen.fillRect(0, y, width, row - line);
      return;
    }
    if (line) {
      pen.fillStyle = colour("backdrop");
      pen.fillRect(0, y, width, row - line);
    }
    pen.fillStyle = colour("stripe");
    let since = -1;
    for (let frame = 0; frame <= frames; frame += 1) {
      const on = frame < frames && holds(clip.start + frame, number);
      if (on && since < 0) since = frame;
      if (!on && since >= 0) {
        const long = Math.max(((frame - since) / frames) * width, 0.75);
        pen.fillRect((since / frames) * width, y, long, row - line);
        since = -1;
      }
    }
  });
  return height;
}

/** A take from its first frame to its last: who is found where, and distance functions. */
function drawTimeline(canvas, entry, chosen) {
  const lanes = lanesOf(entry, chosen);
  const laneHeight = 18;
  const curveHeight = entry.curves.some((curve) => curve.class === chosen.class) ? 62 : 0;
  const { pen, width, height } = sharp(canvas, lanes.length * laneHeight + curveHeight + 16);
  const across = (frame) => (frame / entry.frames) * width;
  pen.font = "11px system-ui, sans-serif";
  pen.textBaseline = "middle";
  lanes.forEach((lane, number) => {
    for (const hit of lane) drawBar(pen, hit, hit === chosen, across, number * laneHeight, laneHeight - 3);
  });
  if (curveHeight) drawCurves(pen, entry, chosen, lanes.length * laneHeight, curveHeight, across, width);
  drawSeconds(pen, entry, across, width, height);
}

/** Hits of a take in as few rows as they fit into without covering each other. */
function lanesOf(entry, chosen) {
  const number = data.documents.indexOf(entry);
  const own = data.hits.filter((hit) => hit.document === number).sort((a, b) => a.start - b.start);
  const lanes = [];
  for (const hit of own) {
    const lane = lanes.find((each) => each.at(-1).end <= hit.start);
    if (lane) lane.push(hit);
    else if (lanes.length < 4 || hit === chosen) lanes.push([hit]);
  }
  return lanes;
}

function drawBar(pen, hit, chosen, across, top, height) {
  const { label, colour: paint } = data.classes[hit.class];
  const [left, right] = [across(hit.start), Math.max(across(hit.end), across(hit.start) + 2)];
  pen.fillStyle = paint;
  pen.globalAlpha = chosen ? 1 : 0.65;
  pen.fillRect(left, top, right - left - 0.5, height);
  pen.globalAlpha = 1;
  if (chosen) {
    pen.strokeStyle = colour("ink");
    pen.lineWidth = 1.5;
    pen.strokeRect(left + 0.75, top + 0.75, right - left - 2, height - 1.5);
  }
  if (pen.measureText(label).width < right - left - 8) {
    pen.fillStyle = chosen ? readableOn(paint) : colour("ink");
    pen.textAlign = "center";
    pen.fillText(label, (left + right) / 2, top + height / 2 + 0.5);
  }
}

function readableOn(paint) {
  const [red, green, blue] = [1, 3, 5].map((at) => parseInt(paint.slice(at, at + 2), 16));
  return 0.299 * red + 0.587 * green + 0.114 * blue > 140 ? "#1b2127" : "#ffffff";
}

function drawCurves(pen, entry, chosen, top, height, across, width) {
  const own = entry.curves.filter((curve) => curve.class === chosen.class);
  const [inner, bottom] = [height - 8, top + height - 2];
  const peak = (curve) => costsOf(curve).reduce((most, cost) => (cost > most ? cost : most), 1.6 * curve.tau);
  const highest = Math.max(...own.map(peak), 1e-6);
  const up = (cost) => bottom - (cost / highest) * inner;
  pen.fillStyle = colour("backdrop");
  pen.fillRect(0, top + 4, width, height - 6);
  pen.fillStyle = data.classes[chosen.class].colour;
  pen.globalAlpha = 0.22;
  pen.fillRect(across(chosen.start), top + 4, across(chosen.end) - across(chosen.start), height - 6);
  pen.globalAlpha = 1;
  for (const curve of own) {
    pen.strokeStyle = colour("ink");
    pen.lineWidth = 1.2;
    pen.lineJoin = "round";
    pen.beginPath();
    let down = false;
    costsOf(curve).forEach((cost, point) => {
      const x = across(Math.min((point + 0.5) * curve.every, entry.frames));
      if (Number.isNaN(cost)) down = false;
      else if (down) pen.lineTo(x, up(cost));
      else pen.moveTo(x, up(cost));
      down = !Number.isNaN(cost);
    });
    pen.stroke();
    pen.strokeStyle = pen.fillStyle = colour("tau");
    pen.setLineDash([5, 3]);
    pen.beginPath();
    pen.moveTo(0, up(curve.tau));
    pen.lineTo(width, up(curve.tau));
    pen.stroke();
    pen.setLineDash([]);
    const words = [`τ ${Number(curve.tau.toPrecision(3))}`, width - 4, up(curve.tau) - 7];
    pen.textAlign = "right";
    pen.strokeStyle = colour("backdrop");
    pen.lineWidth = 4;
    pen.strokeText(...words);
    pen.fillText(...words);
  }
}

function drawSeconds(pen, entry, across, width, height) {
  const duration = entry.frames / data.rate;
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800];
  const step = steps.find((each) => (each / duration) * width > 44) ?? 3600;
  pen.fillStyle = colour("soft");
  for (let number = 0; number * step <= duration; number += 1) {
    const x = across(number * step * data.rate);
    pen.fillRect(x, height - 14, 1, 4);
    if (x > width - 26) continue;
    pen.textAlign = number ? "center" : "left";
    pen.fillText(`${Number((number * step).toFixed(1))} s`, x, height - 5);
  }
}
