// The keyboard.

const next = (places) => () => {
  const card = cardFrom(chosenCard, places());
  choose(card, false);
  card.element.scrollIntoView({ block: "nearest", behavior: calm ? "auto" : "smooth" });
};

// What the list shows, and what each key does.
const KEYS = [
  ["space", "Play or pause", { " ": () => setPlaying(!stage.playing) }],
  ["← →", "The hit before, the next hit", { ArrowLeft: next(() => -1), ArrowRight: next(() => 1) }],
  ["↑ ↓", "A row up, a row down", { ArrowUp: next(() => -cardsInRow()), ArrowDown: next(cardsInRow) }],
  [", .", "One frame back, one on", { ",": () => step(-1), ".": () => step(1) }],
  ["[ ]", "Slower, faster", { "[": () => changeSpeed(-1), "]": () => changeSpeed(1) }],
  ["shift + arrows", "Turn the view", {
    "Shift+ArrowLeft": () => turn(-0.12, 0),
    "Shift+ArrowRight": () => turn(0.12, 0),
    "Shift+ArrowUp": () => turn(0, 0.1),
    "Shift+ArrowDown": () => turn(0, -0.1),
  }],
  ["+ − 0", "Nearer, farther, first view", { "+": () => zoom(0.85), "-": () => zoom(1 / 0.85), 0: resetView }],
  ["c", "Compare beside, over each other, not at all", { c: () => cycle("beside") }],
  ["w", "Play the hit or the whole take", { w: () => cycle("range") }],
  ["a", "Move or stop the small figures", { a: () => setPlayingAll(!playingAll) }],
  ["/", "Filter by document", { "/": () => $("part").focus() }],
  ["t", "Light, dark, or as the system has it", { t: nextTheme }],
  ["?", "This list", { "?": () => $("help").showModal() }],
];
const ACTIONS = Object.assign({}, ...KEYS.map(([, , actions]) => actions));

function cycle(id) {
  const select = $(id);
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
  select.dispatchEvent(new Event("change"));
}

function wireKeys() {
  const list = $("help-keys");
  for (const [keys, says] of KEYS) {
    const [term, meaning] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = keys;
    meaning.textContent = says;
    list.append(term, meaning);
  }
  $("keys").addEventListener("click", () => $("help").showModal());
  document.addEventListener("keydown", (event) => {
    // What is typed into a field is its own; so is what a slider or a list does with arrows.
    const own = event.target.closest("input, select, dialog") !== null;
    const press = event.key === " " && event.target.closest("button") !== null;
    if (own || press || event.ctrlKey || event.metaKey || event.altKey || !chosenCard) return;
    const shifted = event.shiftKey && event.key.startsWith("Arrow") ? `Shift+${event.key}` : event.key;
    const action = ACTIONS[shifted];
    if (!action) return;
    event.preventDefault();
    action();
  });
}
