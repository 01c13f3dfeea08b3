// Everything put together, and the clock that drives it.

const BUDGET = 11; // milliseconds of drawing small figures before the next picture of the screen
const REST = 1.5; // so many times as long as they took, nothing small is drawn: slow machines stay quick

function makeStudio() {
  try {
    return new Studio();
  } catch (error) {
    $("trouble").textContent = `This browser has no WebGL, so the figures stand still (${error.message}).`;
    $("trouble").hidden = false;
    root.classList.add("flat");
    $("stage-still").hidden = false;
    $("view").hidden = true;
    return null;
  }
}

function start() {
  root.classList.add("running");
  const studio = makeStudio();
  let time = 0;
  let last = 0;
  let turnOf = 0;
  let rested = 0; // when small figures may be drawn again

  const refresh = () => {
    for (const card of cards) card.fresh = true;
  };

  const anew = () => {
    studio?.paint();
    for (const card of cards) card.drawn = false;
    refresh();
    drawCharts();
  };

  const drawCards = () => {
    const visible = cards.filter((card) => card.visible && !card.element.hidden);
    const fresh = visible.filter((card) => card.fresh);
    const these = fresh.length || !playingAll ? fresh : visible;
    const began = performance.now();
    let spent = 0;
    for (let i = 0; i < these.length && spent < BUDGET; i += 1) {
      turnOf = (turnOf + 1) % these.length;
      drawCard(these[turnOf], studio, time, playingAll ? speed() : 1, $("beside").value);
      spent = performance.now() - began;
    }
    if (spent > BUDGET) rested = performance.now() + REST * spent;
  };

  const tick = (now) => {
    const passed = Math.min((now - last) / 1000, 0.1);
    last = now;
    moveStage(passed, studio);
    if (playingAll) time += passed;
    if (now >= rested) drawCards();
    requestAnimationFrame(tick);
  };

  fillCards(choose, studio !== null);
  if (!cards.length) {
    filters.hidden = true;
    return;
  }
  $("stage").hidden = false;
  makeFilters();
  filterCards();
  wireStage();
  wireKeys();
  watchLooks(anew);
  setPlaying(stage.playing);
  setPlayingAll(playingAll);
  $("play-all").addEventListener("click", () => setPlayingAll(!playingAll));
  $("beside").addEventListener("change", refresh);
  new ResizeObserver(anew).observe($("viewport"));
  choose(cards[0], false);
  requestAnimationFrame(tick);
}

start();
