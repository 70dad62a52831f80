// Mouse, pen, fingers and keys over the picture.

class Pointer {
  /** `host` has camera, answer(), dragTip(to), dragPlatform(to), moved(). */
  constructor(canvas, host) {
    this.canvas = canvas;
    this.host = host;
    this.fingers = new Map();
    this.mode = "turn";
    document.querySelectorAll('input[name="drag"]').forEach(input => input.addEventListener("change", () => { this.mode = input.value; }));
    canvas.addEventListener("pointerdown", e => this.down(e));
    canvas.addEventListener("pointermove", e => this.move(e));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, e => this.up(e));
    canvas.addEventListener("wheel", e => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", e => this.key(e));
    canvas.addEventListener("contextmenu", e => e.preventDefault());
  }

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  near(point, [x, y]) {
    const [px, py] = this.host.camera.project(point);
    return Math.hypot(px - x, py - y) < 18;
  }

  /** What a press takes hold of: the handle under it, or what is chosen. */
  held(at) {
    const answer = this.host.answer();
    if (!answer) return null;
    const handle = this.near(answer.tip, at) ? "tip" : this.near(answer.a, at) ? "platform" : this.mode;
    const point = { tip: answer.tip, platform: answer.a }[handle];
    return point && { handle, point, offset: subtract(point, this.host.camera.at(...at, point)) };
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    const at = this.place(event);
    this.fingers.set(event.pointerId, at);
    this.grip = this.fingers.size === 1 && event.button === 0 && !event.shiftKey ? this.held(at) : null;
    this.shifting = event.button !== 0 || event.shiftKey;
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const at = this.place(event), [dx, dy] = [at[0] - before[0], at[1] - before[1]];
    const { camera } = this.host;
    if (this.fingers.size === 2) {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = p => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      camera.zoom(apart(before) / apart(at));
      camera.shift(dx / 2, dy / 2);
    } else if (this.grip) {
      const to = add(camera.at(...at, this.grip.point), this.grip.offset);
      if (this.grip.handle === "tip") this.host.dragTip(to);
      else this.host.dragPlatform(to);
    } else if (this.shifting) {
      camera.shift(dx, dy);
    } else {
      camera.turn(dx * 0.008, dy * 0.008);
    }
    this.fingers.set(event.pointerId, at);
    this.host.moved();
  }

  up(event) {
    this.fingers.delete(event.pointerId);
    this.grip = null;
  }

  wheel(event) {
    event.preventDefault();
    this.host.camera.zoom(Math.exp(clamp(event.deltaY, -200, 200) * 0.0012));
    this.host.moved();
  }

  key(event) {
    const { camera } = this.host;
    const way = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1] }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (way && event.shiftKey && this.host.answer()) this.host.dragTip(add(this.host.answer().tip, times(way, 1e-3)));
    else if (way && !way[2]) camera.turn(0.08 * way[0], 0.08 * way[1]);
    else if (event.key === "+" || event.key === "=") camera.zoom(0.9);
    else if (event.key === "-") camera.zoom(1 / 0.9);
    else return;
    event.preventDefault();
    this.host.moved();
  }
}
