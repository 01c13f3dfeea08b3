// Everything put together, and the clock that drives it.

const BUDGET = 11; // milliseconds of drawing small figures before the next picture of the screen

function makeStudio() {
  try {
    return new Studio();
  } catch (error) {
    $("trouble").textContent = `This browser has no WebGL, so the figures stand still (${error.message}).`;
    $("trouble").hidden = false;
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
  let again = true; // small figures are to be drawn even if they stand

  const anew = () => {
    studio?.paint();
    for (const card of cards) card.drawn = false;
    drawCharts();
    again = true;
  };

  const tick = (now) => {
    const passed = Math.min((now - last) / 1000, 0.1);
    last = now;
    moveStage(passed, studio);
    if (playingAll) time += passed;
    const visible = cards.filter((card) => card.visible && !card.element.hidden);
    const waiting = visible.filter((card) => !card.drawn);
    const these = playingAll || again ? visible : waiting;
    const began = performance.now();
    for (let i = 0; i < these.length; i += 1) {
      turnOf = (turnOf + 1) % these.length;
      drawCard(these[turnOf], studio, time, playingAll ? speed() : 1, $("beside").value);
      if (performance.now() - began > BUDGET && i + 1 < these.length) break;
      if (i + 1 === these.length) again = false;
    }
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
  $("beside").addEventListener("change", () => { again = true; });
  new ResizeObserver(anew).observe($("viewport"));
  choose(cards[0], false);
  requestAnimationFrame(tick);
}

start();
