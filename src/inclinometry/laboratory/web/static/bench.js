// The bench page: numbers put in place without building anything anew, and keys.
(() => {
  "use strict";
  let heard = 0;

  const put = (id, text) => {
    const place = document.getElementById(id);
    if (place && place.textContent !== text) place.textContent = text;
  };

  // [state, colour, word, advice, temperature, detail, ...cells]
  window.benchLive = (said) => {
    heard = Date.now();
    const [state, colour, word, advice, heat, detail, ...cells] = said;
    const verdict = document.getElementById("live-word");
    if (!verdict) return;
    if (verdict.dataset.state !== state) {
      verdict.dataset.state = state;
      verdict.className = `word ${colour}`;
    }
    put("live-word", word);
    put("live-advice", advice);
    put("live-heat", heat);
    put("live-detail", detail);
    cells.forEach((text, i) => put(`live-${i}`, text));
  };

  // a long list of positions shows the chosen one; the page itself stays where it is
  window.benchHere = () => {
    const here = document.querySelector(".place.here");
    const list = here?.closest(".positions");
    if (list) list.scrollTop = here.offsetTop - list.offsetTop - list.clientHeight / 2;
  };

  // a verdict must not stay on the screen when nothing arrives any more
  setInterval(() => {
    const verdict = document.getElementById("live-word");
    if (!verdict || !heard || Date.now() - heard < 2000 || verdict.dataset.state === "lost") return;
    verdict.dataset.state = "lost";
    verdict.className = "word bad";
    verdict.textContent = verdict.dataset.lost;
    put("live-advice", "");
  }, 500);

  const KEYS = { ArrowRight: "forward", ArrowLeft: "back", a: "automatic", n: "next", t: "turn" };

  // capture phase: a key that is held down presses a button once, not thirty times a second
  document.addEventListener("keydown", (event) => {
    if (!document.querySelector(".bench") || event.ctrlKey || event.altKey || event.metaKey) return;
    const presses = event.key === " " || event.key === "Enter";
    if (event.repeat && presses) {
      event.preventDefault();
      event.stopPropagation();
      return;
    }
    if (document.querySelector(".q-dialog")) return;
    const at = document.activeElement;
    if (at && at.matches("input:not([type=checkbox]), textarea, select, [contenteditable=true], .q-field *")) return;
    if (presses) {
      // on a button, link or switch these keys are its own
      if (at && at !== document.body && at.closest("button, a, summary, [role=switch], [role=button], [tabindex='0']"))
        return;
      event.preventDefault();
      if (event.target.closest?.(".page, body")) emitEvent("bench_key", "capture");
      return;
    }
    const what = KEYS[event.key] || KEYS[event.key.toLowerCase()];
    if (!what) return;
    event.preventDefault();
    if (!event.repeat) emitEvent("bench_key", what);
  }, true);
})();
