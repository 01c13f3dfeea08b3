// The chosen hit: large, to be turned, stopped and compared.

const stage = { hit: null, clip: null, frame: 0, playing: !calm, fresh: true, view: { ...FIRST_VIEW } };

function choose(card, byHand) {
  chosenCard?.element.removeAttribute("aria-current");
  chosenCard = card;
  card.element.setAttribute("aria-current", "true");
  stage.hit = card.hit;
  const entry = data.documents[card.hit.document];
  const { label, colour: paint } = data.classes[card.hit.class];
  $("stage-swatch").style.background = paint;
  $("stage-label").textContent = label;
  $("stage-document").textContent = entry.name;
  const rank = card.hit.rank === null ? "" : `rank ${card.hit.rank} · `;
  const cost = Number(card.hit.cost.toPrecision(4));
  $("stage-facts").textContent = `${rank}cost ${cost} · ${seconds(card.hit.start)} – ${seconds(card.hit.end)} s`;
  $("stage-still").replaceChildren(card.element.querySelector(".still").cloneNode(true));
  const reference = card.hit.reference === null ? null : data.references[card.hit.reference];
  const itself = reference?.hit !== null && data.hits[reference?.hit] === card.hit;
  $("beside-choice").hidden = reference === null || itself;
  $("reference-name").textContent = reference === null || itself ? "" : reference.name;
  setRange();
  if (byHand && $("stage").getBoundingClientRect().bottom < 120) {
    $("stage").scrollIntoView({ behavior: calm ? "auto" : "smooth" });
  }
}

/** Play the hit, or all of its take that there is. */
function setRange() {
  const hit = stage.hit;
  const take = $("range").value === "take";
  const before = stage.clip;
  stage.clip = take ? takeClip(hit) : hitClip(hit);
  const kept = before?.piece === stage.clip.piece && stage.frame >= hit.start && stage.frame < hit.end;
  if (!kept) stage.frame = hit.start;
  const entry = data.documents[hit.document];
  const { start, frames } = stage.clip.piece;
  const held = ` · the page holds ${seconds(start)} – ${seconds(start + frames)} s`;
  stage.told = `${seconds(entry.frames)} s${frames === entry.frames ? "" : held}`;
  $("take").textContent = stage.told;
  drawCharts();
}

function drawCharts() {
  if (!stage.hit) return;
  const entry = data.documents[stage.hit.document];
  const row = innerHeight < 900 ? 2 : 3;
  drawStripes($("stripes").firstElementChild, stage.clip, entry.untrusted, row);
  drawTimeline($("timeline").firstElementChild, entry, stage.hit);
  stage.widths = { stripes: $("stripes").clientWidth, timeline: $("timeline").clientWidth };
  stage.fresh = true;
}

function setPlaying(playing) {
  stage.playing = playing;
  $("play").textContent = playing ? "❚❚" : "▶";
  $("play").setAttribute("aria-label", playing ? "Pause" : "Play");
}

function speed() {
  return Number($("speed").value);
}

function changeSpeed(places) {
  const { options } = $("speed");
  options.selectedIndex = Math.min(Math.max(options.selectedIndex + places, 0), options.length - 1);
}

/** Go to a frame of the document; within what is played. */
function seek(frame) {
  stage.frame = Math.min(Math.max(frame, stage.clip.start), stage.clip.end - 1);
  stage.fresh = true;
}

function step(frames) {
  setPlaying(false);
  seek(Math.round(stage.frame) + frames);
}

/** Let time go on, then draw if anything is other than it was. */
function moveStage(passed, studio) {
  if (!stage.clip) return;
  const { clip } = stage;
  if (stage.playing) {
    const length = Math.max(clip.end - clip.start - 1, 1e-6);
    stage.frame = clip.start + ((stage.frame - clip.start + passed * data.rate * speed()) % length);
    stage.fresh = true;
  }
  if (!stage.fresh) return;
  stage.fresh = false;
  const { frame, hit } = stage;
  const share = (frame - clip.start) / Math.max(clip.end - clip.start - 1, 1);
  $("scrub").value = String(1000 * share);
  $("clock").textContent = `${seconds(frame - clip.start)} / ${seconds(clip.end - clip.start)} s`;
  $("scrub").setAttribute("aria-valuetext", $("clock").textContent);
  const total = data.documents[hit.document].frames;
  moveHead("stripes", (frame - clip.start + 0.5) / (clip.end - clip.start));
  moveHead("timeline", (frame + 0.5) / total);
  $("now").textContent = $("range").value === "take" ? labelsAt(hit.document, frame) : "";
  if (studio) drawStage(studio);
}

function drawStage(studio) {
  const { clip, frame, hit } = stage;
  const canvas = $("view");
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const { clientWidth, clientHeight } = $("viewport");
  const [width, height] = [clientWidth, clientHeight].map((length) => Math.round(length * ratio));
  if (!width || !height) return;
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const within = frame >= hit.start && frame < hit.end;
  const other = within ? otherFor(hit, frame, $("beside").value) : null;
  $("legend-reference").hidden = other === null;
  studio.draw(canvas, clip, frame, stage.view, other);
}

function moveHead(chart, share) {
  $(chart).lastElementChild.style.transform = `translateX(${(share * stage.widths[chart]).toFixed(1)}px)`;
}

function labelsAt(number, frame) {
  const now = data.hits.filter((hit) => hit.document === number && hit.start <= frame && frame < hit.end);
  return [...new Set(now.map((hit) => data.classes[hit.class].label))].join(", ");
}

function turn(azimuth, elevation) {
  stage.view.azimuth += azimuth;
  stage.view.elevation = Math.min(Math.max(stage.view.elevation + elevation, 0.02), 1.5);
  stage.fresh = true;
}

function zoom(factor) {
  stage.view.distance = Math.min(Math.max(stage.view.distance * factor, 0.35), 5);
  stage.fresh = true;
}

function resetView() {
  stage.view = { ...FIRST_VIEW };
  stage.fresh = true;
}

/** Follow a pointer from where it goes down until it is let go. */
function drag(element, moved) {
  element.addEventListener("pointerdown", (event) => {
    if (event.button || event.target.closest("button")) return;
    element.setPointerCapture(event.pointerId);
    let last = event;
    moved(event, event);
    const move = (next) => {
      moved(next, last);
      last = next;
    };
    element.addEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel"]) {
      element.addEventListener(end, () => element.removeEventListener("pointermove", move), { once: true });
    }
  });
}

function shareOf(event, element) {
  const box = element.getBoundingClientRect();
  return Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
}

/** Jump to a time of the take; to another hit, where that time is its own. */
function seekTake(event) {
  const entry = data.documents[stage.hit.document];
  const frame = shareOf(event, $("timeline")) * entry.frames;
  const inside = (hit) => hit.document === stage.hit.document && hit.start <= frame && frame < hit.end;
  if ($("range").value === "hit" && !inside(stage.hit)) {
    const card = cards.find(({ hit, element }) => inside(hit) && !element.hidden);
    if (card) choose(card, false);
  }
  seek(frame);
}

function tellFeature(event) {
  const box = $("stripes").getBoundingClientRect();
  const number = Math.floor(((event.clientY - box.top) / box.height) * data.features.length);
  const feature = data.features[Math.min(Math.max(number, 0), data.features.length - 1)];
  $("feature").textContent = `${feature.id} ${feature.name} (${feature.part})`;
}

function tellTake(event) {
  const frame = shareOf(event, $("timeline")) * data.documents[stage.hit.document].frames;
  const labels = labelsAt(stage.hit.document, frame);
  $("take").textContent = `${seconds(frame)} s${labels && ` · ${labels}`}`;
}

function wireStage() {
  $("play").addEventListener("click", () => setPlaying(!stage.playing));
  $("back").addEventListener("click", () => step(-1));
  $("on").addEventListener("click", () => step(1));
  $("nearer").addEventListener("click", () => zoom(0.85));
  $("farther").addEventListener("click", () => zoom(1 / 0.85));
  $("reset").addEventListener("click", resetView);
  $("range").addEventListener("change", setRange);
  $("beside").addEventListener("change", () => { stage.fresh = true; });
  $("scrub").addEventListener("input", () => {
    setPlaying(false);
    seek(stage.clip.start + (Number($("scrub").value) / 1000) * (stage.clip.end - stage.clip.start - 1));
  });
  drag($("viewport"), (event, last) => turn((last.clientX - event.clientX) * 0.01, (event.clientY - last.clientY) * 0.008));
  drag($("stripes"), (event) => {
    setPlaying(false);
    seek(stage.clip.start + shareOf(event, $("stripes")) * (stage.clip.end - stage.clip.start));
  });
  drag($("timeline"), seekTake);
  $("stripes").addEventListener("pointermove", tellFeature);
  $("stripes").addEventListener("pointerleave", () => { $("feature").textContent = ""; });
  $("timeline").addEventListener("pointermove", tellTake);
  $("timeline").addEventListener("pointerleave", () => { $("take").textContent = stage.told; });
  $("viewport").addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(event.deltaY * 0.001));
  }, { passive: false });
}
