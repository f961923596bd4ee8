// A button of class "hold" sends "held" once it was held for HOLD ms, with the newest beat of the
// page's pulse; the page turns grey when its pulse stops.
(() => {
  // ms; CSS pixels. A hold is counted in ticks, of which none counts for more than LATE and no late one
  // completes it: a page that did not run meanwhile has not seen yet what the finger did.
  const HOLD = 1500, TICK = 100, LATE = 200, FRESH = 1500, LOST = 3000, SLIDE = 40;
  let held = null, timer = null, counted = 0, ticked = 0, from = null;
  // -Infinity: nothing of now was received yet.
  let beat = "", at = -Infinity;
  const opened = performance.now();
  const age = () => performance.now() - at;
  const begin = (button, event) => {
    if (!button || held || age() > FRESH) return;
    held = button;
    from = event;
    counted = 0;
    ticked = performance.now();
    button.classList.add("holding");
    timer = setInterval(tick, TICK);
  };
  const tick = () => {
    const passed = performance.now() - ticked;
    ticked += passed;
    counted += Math.min(passed, LATE);
    if (document.hidden || !held.isConnected || age() > FRESH) return end();
    if (counted < HOLD || passed > LATE) return;
    const done = held;
    end();
    done.dispatchEvent(new CustomEvent("held", {detail: Number(beat)}));
  };
  const end = () => {
    clearInterval(timer);
    if (held) held.classList.remove("holding");
    held = timer = from = null;
  };
  const buttonOf = (event) => event.target.closest && event.target.closest("button.hold");
  document.addEventListener("pointerdown", (event) => {
    if (event.button === 0 && event.isPrimary) begin(buttonOf(event), event);
    else end();
  });
  for (const kind of ["pointerup", "pointercancel", "keyup"]) document.addEventListener(kind, end);
  // What had the focus before loses it as the button is pressed.
  document.addEventListener("focusout", (event) => { if (buttonOf(event) === held) end(); });
  document.addEventListener("pointermove", (event) => {
    if (!held || from === null) return;
    // A finger that slides off has changed its mind; a page that moves under it has no mind.
    const slid = Math.hypot(event.clientX - from.clientX, event.clientY - from.clientY) > SLIDE;
    if (slid || !(event.buttons & 1)) end();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return end();
    const button = buttonOf(event);
    if (!button) return;
    event.preventDefault();
    if (!event.repeat) begin(button, null);
  });
  document.addEventListener("contextmenu", (event) => { if (buttonOf(event)) event.preventDefault(); });
  window.addEventListener("blur", end);

  const look = () => {
    const pulse = document.querySelector(".pulse");
    if (!pulse) return;
    if (pulse.textContent !== beat) { beat = pulse.textContent; at = performance.now(); }
    const lost = age() > LOST && performance.now() - opened > LOST;
    document.body.classList.toggle("lost", lost);
    if (lost) end();
  };
  // The clock of a page stands still while a phone sleeps: until the next beat all of it is old.
  const woke = () => {
    end();
    if (!document.hidden) { at = -Infinity; look(); }
  };
  document.addEventListener("visibilitychange", woke);
  window.addEventListener("pageshow", (event) => { if (event.persisted) woke(); });
  setInterval(look, 250);
})();
