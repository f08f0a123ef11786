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

  // three angles as they are now, then their differences to the target; empty without a calibration; which are far off
  window.benchNow = (angles, far) => {
    ["azimuth", "inclination", "toolface"].forEach((name, i) => {
      const place = document.getElementById(`now-${name}`)?.parentElement;
      if (place) place.style.visibility = angles.length ? "visible" : "hidden";
      put(`now-${name}`, angles[i] || "");
      put(`off-${name}`, angles[i + 3] || "");
      document.getElementById(`off-${name}`)?.classList.toggle("far", far.includes(name));
    });
  };

  window.benchStrip = (html) => {
    const place = document.getElementById("strip");
    if (place) place.innerHTML = html;
  };

  // a short sound when a position is captured, unless this browser has it switched off
  const SOUND = "inclinometry_sound";
  const quiet = () => localStorage.getItem(SOUND) === "off";
  let audio = null;
  window.benchBeep = () => {
    if (quiet()) return;
    audio = audio || new AudioContext();
    const tone = audio.createOscillator(), volume = audio.createGain();
    tone.frequency.value = 880;
    volume.gain.setValueAtTime(0.2, audio.currentTime);
    volume.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + 0.25);
    tone.connect(volume).connect(audio.destination);
    tone.start();
    tone.stop(audio.currentTime + 0.25);
    window.beeped = (window.beeped || 0) + 1;
  };
  const showSound = () => {
    const icon = document.querySelector("#bench-sound .q-icon");
    if (icon) icon.textContent = quiet() ? "volume_off" : "volume_up";
    document.getElementById("bench-sound")?.setAttribute("aria-pressed", String(!quiet()));
  };
  window.benchSound = () => {
    localStorage.setItem(SOUND, quiet() ? "on" : "off");
    showSound();
    window.benchBeep();
  };
  const waiting = setInterval(() => {
    if (!document.querySelector("#bench-sound .q-icon")) return;
    clearInterval(waiting);
    showSound();
  }, 100);

  // target, live angles, verdict and channels alone, to be read from two metres
  const large = (on) => document.body.classList.toggle("large", on);
  window.benchLarge = () => {
    const on = !document.body.classList.contains("large");
    large(on);
    if (on) document.documentElement.requestFullscreen?.().catch(() => {});
    else if (document.fullscreenElement) document.exitFullscreen();
  };
  document.addEventListener("fullscreenchange", () => large(!!document.fullscreenElement));

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
    if (event.key.toLowerCase() === "f") {
      event.preventDefault();
      if (!event.repeat) window.benchLarge();
      return;
    }
    const what = KEYS[event.key] || KEYS[event.key.toLowerCase()];
    if (!what) return;
    event.preventDefault();
    if (!event.repeat) emitEvent("bench_key", what);
  }, true);
})();
