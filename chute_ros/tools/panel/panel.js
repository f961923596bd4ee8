// A button of class "hold" sends "held" once it was held for HOLD ms; the page turns grey when its
// pulse stops for LOST ms.
(() => {
  const HOLD = 1500, LOST = 3000, SLIDE = 40;  // ms, ms, CSS pixels
  let held = null, timer = null, from = null;
  let beat = "", at = performance.now();
  const pulse = () => document.querySelector(".pulse");
  const begin = (button) => {
    if (!button || held) return;
    held = button;
    button.classList.add("holding");
    timer = setTimeout(() => {
      const done = held;
      end();
      // With the newest pulse: what arrives late, after a connection that was cut, is not obeyed.
      done.dispatchEvent(new CustomEvent("held", {detail: Number(pulse()?.textContent)}));
    }, HOLD);
  };
  const end = () => {
    clearTimeout(timer);
    if (held) held.classList.remove("holding");
    held = timer = from = null;
  };
  const buttonOf = (event) => event.target.closest && event.target.closest("button.hold");
  document.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !event.isPrimary) return;
    from = event;
    begin(buttonOf(event));
  });
  for (const kind of ["pointerup", "pointercancel", "keyup"])
    document.addEventListener(kind, end);
  document.addEventListener("pointermove", (event) => {
    // A finger that slides off has changed its mind; a page that moves under it has no mind.
    if (held && from && Math.hypot(event.clientX - from.clientX, event.clientY - from.clientY) > SLIDE)
      end();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    const button = buttonOf(event);
    if (!button) return;
    event.preventDefault();
    if (!event.repeat) begin(button);
  });
  document.addEventListener("contextmenu", (event) => { if (buttonOf(event)) event.preventDefault(); });
  document.addEventListener("visibilitychange", end);
  window.addEventListener("blur", end);

  setInterval(() => {
    if (!pulse()) return;
    if (pulse().textContent !== beat) { beat = pulse().textContent; at = performance.now(); }
    const lost = performance.now() - at > LOST;
    document.body.classList.toggle("lost", lost);
    if (lost) end();
  }, 500);
})();
