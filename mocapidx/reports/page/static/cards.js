// The small figures, and which of them pass the filters.

const HOLD = 0.6; // seconds that the last pose of a small figure stays
const STRIPES_HIGH = 20;

const cards = [...document.querySelectorAll(".card")].map((element) => ({
  element,
  number: Number(element.dataset.hit),
  hit: data.hits[Number(element.dataset.hit)],
  visible: false,
  drawn: false, // its stripes
  fresh: true, // to be drawn even if nothing moves
}));
let playingAll = !calm;
let chosenCard = null;

const byElement = new Map(cards.map((card) => [card.element, card]));
const watcher = new IntersectionObserver((entries) => {
  for (const entry of entries) byElement.get(entry.target).visible = entry.isIntersecting;
}, { rootMargin: "60px" });

/** Give every card a canvas over its still picture, and stripes below. */
function fillCards(choose, moving) {
  for (const card of cards) {
    const mini = document.createElement("span");
    mini.className = "mini";
    card.stripes = document.createElement("canvas");
    card.head = document.createElement("i");
    card.head.className = "head";
    mini.append(card.stripes, card.head);
    card.element.querySelector(".view").after(mini);
    if (moving) {
      card.canvas = document.createElement("canvas");
      card.canvas.hidden = true; // until there is something on it
      card.element.querySelector(".view").append(card.canvas);
    }
    card.element.querySelector("button").addEventListener("click", () => choose(card, true));
    watcher.observe(card.element);
  }
}

/** Draw a visible card as it is at a time in seconds. */
function drawCard(card, studio, time, speed, mode) {
  const clip = hitClip(card.hit);
  card.fresh = false;
  if (!card.drawn) drawMini(card, clip);
  const frames = clip.end - clip.start;
  const place = (time * data.rate * speed) % (frames + HOLD * data.rate);
  const frame = clip.start + Math.min(place, frames - 1);
  card.head.style.transform = `translateX(${(Math.min(place / frames, 1) * card.width).toFixed(1)}px)`;
  if (!studio) return;
  const other = mode === "over" ? otherFor(card.hit, frame, mode) : null;
  studio.draw(card.canvas, clip, frame, CARD_VIEW, other);
  card.canvas.hidden = false;
}

function drawMini(card, clip) {
  card.drawn = true;
  card.width = card.stripes.clientWidth;
  const full = document.createElement("canvas");
  Object.defineProperty(full, "clientWidth", { value: card.width });
  drawStripes(full, clip, data.documents[card.hit.document].untrusted, 2);
  const { pen, width } = sharp(card.stripes, STRIPES_HIGH);
  pen.drawImage(full, 0, 0, width, STRIPES_HIGH);
  if (!card.canvas) return;
  const ratio = Math.min(devicePixelRatio || 1, 1.5);
  const view = card.canvas.parentElement;
  card.canvas.width = Math.round(view.clientWidth * ratio);
  card.canvas.height = Math.round(view.clientHeight * ratio);
}

function otherFor(hit, frame, mode) {
  const clip = mode === "off" ? null : referenceClip(hit);
  return clip && clip !== hitClip(hit) ? { clip, frame: referenceFrame(hit, frame), mode } : null;
}

const filters = $("filters");
const costSlider = $("cost");
const classBoxes = [];

function makeFilters() {
  const place = $("classes");
  data.classes.forEach(({ label, colour: paint }, number) => {
    const count = data.hits.filter((hit) => hit.class === number).length;
    if (!count) return;
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = true;
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.style.background = paint;
    const name = document.createElement("span");
    name.textContent = label;
    const many = document.createElement("b");
    many.textContent = count;
    const whole = document.createElement("label");
    whole.className = "class";
    whole.title = "Alt and click: only this class";
    whole.append(box, swatch, name, many);
    whole.addEventListener("click", (event) => {
      if (!event.altKey) return;
      event.preventDefault();
      const alone = classBoxes.every((each) => each.box.checked === (each.box === box));
      for (const each of classBoxes) each.box.checked = alone || each.box === box;
      filterCards();
    });
    classBoxes.push({ box, number });
    place.append(whole);
  });
  place.hidden = classBoxes.length < 2;
  const costs = data.hits.map((hit) => hit.cost);
  costSlider.closest("label").hidden = Math.max(...costs) <= Math.min(...costs) || costs.length < 2;
  filters.addEventListener("input", filterCards);
  filters.addEventListener("submit", (event) => event.preventDefault());
}

function highestCost() {
  const costs = data.hits.map((hit) => hit.cost);
  const [low, high] = [Math.min(...costs), Math.max(...costs)];
  const share = Number(costSlider.value) / 1000;
  return share >= 1 ? Infinity : low + share * (high - low);
}

/** Show what passes, in the order that is asked for. */
function filterCards() {
  const classes = new Set(classBoxes.filter(({ box }) => box.checked).map(({ number }) => number));
  const most = highestCost();
  const part = $("part").value.trim().toLowerCase();
  let count = 0;
  for (const { element, hit } of cards) {
    const { name } = data.documents[hit.document];
    const passes = classes.has(hit.class) && hit.cost <= most && name.toLowerCase().includes(part);
    element.hidden = !passes;
    count += passes;
  }
  sortCards();
  $("cost-value").textContent = most === Infinity ? "all" : most.toPrecision(3);
  $("shown").textContent = count === cards.length ? `all ${count}` : `${count} of ${cards.length}`;
  $("none-left").hidden = count > 0 || cards.length === 0;
}

const ORDERS = {
  file: () => 0,
  cost: (a, b) => a.hit.cost - b.hit.cost,
  document: (a, b) => a.hit.document !== b.hit.document
    ? (data.documents[a.hit.document].name < data.documents[b.hit.document].name ? -1 : 1)
    : a.hit.start - b.hit.start,
  length: (a, b) => a.hit.end - a.hit.start - (b.hit.end - b.hit.start),
};

let ordered = "file";
function sortCards() {
  const order = $("order").value;
  if (order === ordered) return;
  ordered = order;
  cards.sort((a, b) => ORDERS[order](a, b) || a.number - b.number);
  $("cards").append(...cards.map(({ element }) => element));
}

/** The card so many places on among those that pass. */
function cardFrom(card, places) {
  const passing = cards.filter(({ element }) => !element.hidden);
  if (!passing.length) return card;
  const now = passing.indexOf(card);
  if (now < 0) return passing[0];
  return passing[Math.min(Math.max(now + places, 0), passing.length - 1)];
}

/** How many cards stand in a row. */
function cardsInRow() {
  const passing = cards.filter(({ element }) => !element.hidden);
  const top = passing[0]?.element.offsetTop;
  return Math.max(passing.filter(({ element }) => element.offsetTop === top).length, 1);
}

function setPlayingAll(playing) {
  playingAll = playing;
  const button = $("play-all");
  button.textContent = playing ? "Pause all" : "Play all";
  button.setAttribute("aria-pressed", String(playing));
}
