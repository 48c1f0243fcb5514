// The view of a notebook: what the mouse does goes to Python, pictures come back. One picture is asked for at a time;
// what the mouse does meanwhile goes with the next.

function render({ model, el }) {
  const image = document.createElement("img");
  image.draggable = false;
  image.style.cssText = "display:block;touch-action:none;cursor:grab;max-width:100%";
  image.width = model.get("width");
  image.height = model.get("height");
  el.appendChild(image);

  let moves = [];
  let waiting = false;
  let still = null;
  let shown = null;

  const ask = (moving) => {
    clearTimeout(still);
    if (waiting) return;
    waiting = true;
    model.send({ moves, moving });
    moves = [];
    // The last picture of a move is a whole one.
    if (moving) still = setTimeout(() => ask(false), 300);
  };

  const onMessage = (message, buffers) => {
    waiting = false;
    const type = message.kind === "jpg" ? "image/jpeg" : "image/png";
    const address = URL.createObjectURL(new Blob([buffers[0]], { type }));
    image.src = address;
    if (shown) URL.revokeObjectURL(shown);
    shown = address;
    if (moves.length) ask(true);
    else if (message.kind === "jpg") still = setTimeout(() => ask(false), 300);
  };
  model.on("msg:custom", onMessage);

  let held = null;
  const add = (name, values) => {
    const last = moves[moves.length - 1];
    if (last && last[0] === name && name !== "reset") {
      last[1] = last[1].map((value, i) => (name === "zoom" ? value * values[i] : value + values[i]));
    } else {
      moves.push([name, values]);
    }
    ask(true);
  };
  image.addEventListener("pointerdown", (event) => {
    held = { x: event.clientX, y: event.clientY, pan: event.button === 2 || event.shiftKey };
    image.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  image.addEventListener("pointermove", (event) => {
    if (!held) return;
    const height = image.clientHeight || 1;
    add(held.pan ? "pan" : "turn", [(event.clientX - held.x) / height, (event.clientY - held.y) / height]);
    held.x = event.clientX;
    held.y = event.clientY;
  });
  image.addEventListener("pointerup", () => { held = null; });
  image.addEventListener("wheel", (event) => {
    event.preventDefault();
    add("zoom", [Math.exp(-0.001 * event.deltaY)]);
  }, { passive: false });
  image.addEventListener("dblclick", () => add("reset", []));
  image.addEventListener("contextmenu", (event) => event.preventDefault());
  ask(false);

  return () => {
    clearTimeout(still);
    model.off("msg:custom", onMessage);
    if (shown) URL.revokeObjectURL(shown);
  };
}

export default { render };
