// Colours of the style sheet, in light and in dark.

const THEMES = ["auto", "light", "dark"];
const root = document.documentElement;
const probe = document.createElement("i");
const known = new Map();
let lookChanged = () => {};

/** A colour of the style sheet as `rgb(...)`. */
function colour(name) {
  if (!known.has(name)) {
    if (!probe.isConnected) {
      probe.hidden = true;
      document.body.append(probe);
    }
    probe.style.color = `var(--${name})`;
    known.set(name, getComputedStyle(probe).color);
  }
  return known.get(name);
}

function setTheme(theme) {
  if (theme === "auto") delete root.dataset.theme;
  else root.dataset.theme = theme;
  $("theme").textContent = `Theme: ${theme}`;
  known.clear();
  lookChanged();
}

function nextTheme() {
  const now = THEMES.indexOf(root.dataset.theme ?? "auto");
  setTheme(THEMES[(now + 1) % THEMES.length]);
}

function watchLooks(changed) {
  lookChanged = changed;
  $("theme").addEventListener("click", nextTheme);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => setTheme(root.dataset.theme ?? "auto"));
}

const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
