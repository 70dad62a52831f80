// From an answer of the core to bodies, lines and labels.

/** What is drawn beside the machine, and whether it is at first. */
const LAYERS = {
  deflection: ["Deflected machine", true],
  ellipsoid_a: ["Compliance ellipsoid at A", false],
  ellipsoid_tip: ["Compliance ellipsoid at the tip", true],
  box: ["Table's box, of the tip (wrist held)", true],
  frames: ["Frames B and A", true],
  names: ["Names of joints", false],
};

class Scene {
  constructor(data) {
    this.data = data;
    this.colours = {};
    this.plates = {};
    this.begin();
  }

  begin() {
    this.bodies = [];
    this.lines = [];
    this.labels = [];
    this.hue = null;
    this.alpha = 1;
    this.front = false;
    this.moved = p => p;
  }

  // -- parts --

  body(mesh, at, colour) {
    this.bodies.push({ mesh, at, colour: this.colours[this.hue ?? colour], alpha: this.alpha, front: this.front });
  }

  bar(from, to, radius, colour, mesh = Mesh.cylinder) {
    const [a, b] = [this.moved(from), this.moved(to)];
    if (norm(subtract(b, a)) > 1e-9) this.body(mesh, along(a, b, radius), colour);
  }

  ball(at, radius, colour) {
    const m = this.moved(at);
    this.body(Mesh.ball, affine([radius, 0, 0], [0, radius, 0], [0, 0, radius], m), colour);
  }

  line(points, colour) {
    this.lines.push({ points, colour: this.colours[colour] });
  }

  label(at, text, kind = "") {
    this.labels.push({ at, text, kind });
  }

  /** An arrow that ends in a point. */
  arrow(from, to, radius, colour) {
    const way = subtract(to, from), length = norm(way);
    if (!(length > 1e-9)) return;
    this.front = true;
    const head = Math.min(6 * radius, 0.6 * length);
    const neck = subtract(to, times(way, head / length));
    this.bar(from, neck, radius, colour);
    this.bar(neck, to, 2.4 * radius, colour, Mesh.cone);
    this.front = false;
  }

  handle(at) {
    this.front = true;
    this.ball(at, 0.045 * this.size(), "handle");
    this.front = false;
  }

  // -- the machine --

  size() {
    const g = this.data.machine.numbers;
    return 0.5 * Math.max(g[2], g[3]);
  }

  /** Middle and half size of the machine, for a picture that has all of it. */
  extent(answer) {
    const points = [answer.tip, ...[0, 1, 2].flatMap(i => {
      const [b, a] = [part(answer.base, i), part(answer.joints, i)], drawn = this.data.machine.drawing.limbs[i];
      return [a, b, subtract(b, times(unit(subtract(a, b)), (drawn.behind ?? 0) + 2.1 * drawn.tube))];
    })];
    const ends = [0, 1, 2].map(i => [Math.min(...points.map(p => p[i])), Math.max(...points.map(p => p[i]))]);
    return [ends.map(([low, high]) => (low + high) / 2), Math.hypot(...ends.map(([low, high]) => (high - low) / 2))];
  }

  /** Colour of a place where something was found. */
  at(place, colour) {
    return this.found?.has(place) ? "found" : colour;
  }

  plateOf(name, bores, drawn, radius) {
    const key = `${name} ${bores.flat().map(v => v.toFixed(6))}`;
    this.plates[name] ??= {};
    if (this.plates[name].key !== key) {
      const thickness = drawn?.thickness ?? 0.25 * this.size();
      const rim = drawn ? drawn.bore / 2 + drawn.rim : radius;
      this.plates[name] = { key, mesh: Mesh.plate(bores, rim, thickness) };
    }
    return this.plates[name].mesh;
  }

  machine(answer) {
    this.base(answer);
    for (let limb = 0; limb < 3; limb++) this.limb(answer, limb);
    this.platform(answer);
    this.wrist(answer);
  }

  base(answer) {
    const bores = [0, 1, 2].map(i => part(answer.base, i).slice(0, 2));
    const { base } = this.data.machine.drawing;
    const mesh = this.plateOf("base", [...bores, [0, 0]], base, 0.3 * this.size());
    this.body(mesh, affine([1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]), this.at("base", "base"));
  }

  limb(answer, i) {
    const drawn = this.data.machine.drawing.limbs[i];
    const place = name => `limb.${i + 1}.${name}`;
    const [b, a] = [part(answer.base, i), part(answer.joints, i)];
    const n = unit(subtract(a, b)), length = norm(subtract(a, b));
    const on = s => add(b, times(n, s));
    const radius = drawn.tube / 2;
    const body = this.at(place("body"), `limb${i + 1}`);
    if (drawn.ram) {
      const end = Math.min(drawn.tube_length, length - 0.02), rear = -drawn.behind;
      this.bar(on(rear), on(end), radius, body);
      this.bar(on(Math.max(length - drawn.ram_length, 0)), a, drawn.ram / 2, this.at(place("body"), "ram"));
      this.bar(on(rear - 1.5 * radius), on(rear), 0.75 * radius, "drive");
      this.bar(on(rear - 4.2 * radius), on(rear - 1.5 * radius), 1.15 * radius, "drive");
    } else {
      this.bar(b, a, radius, body);
      this.bar(on(-4 * radius), b, 0.8 * radius, "drive");
    }
    const axes = answer.base_axes.slice(9 * i, 9 * i + 9), own = answer.body_axes.slice(9 * i, 9 * i + 9);
    const pin = (at, axis, half, colour) => this.bar(add(at, times(axis, -half)), add(at, times(axis, half)), 0.42 * radius, colour);
    const base = this.at(place("base_joint"), "joint"), platform = this.at(place("platform_joint"), "joint");
    const first = part(axes, 0);
    pin(b, first, 1.75 * radius, base);
    if (i < 2) pin(b, part(axes, 1), 1.75 * radius, base);
    if (i < 2) pin(a, part(own, 0), 1.5 * radius, platform);
    else this.ball(a, 0.95 * radius, platform);
    if (this.layers.names) {
      this.label(b, `B${i + 1}`);
      this.label(a, `A${i + 1}`);
    }
  }

  platform(answer) {
    const [u, v, w] = [0, 1, 2].map(i => part(answer.platform, i));
    const bores = [0, 1, 2].map(i => { const p = subtract(part(answer.joints, i), answer.a); return [dot(p, u), dot(p, v)]; });
    const drawn = this.data.machine.drawing.platform;
    const mesh = this.plateOf("platform", [...bores, [0, 0]], drawn, 0.2 * this.size());
    // a plate that is moved turns with its directions
    const o = this.moved(answer.a);
    const axis = d => subtract(this.moved(add(answer.a, d)), o);
    this.body(mesh, affine(axis(u), axis(v), axis(w), o), this.at("moving_platform", "platform"));
  }

  wrist(answer) {
    const [w, y, z] = [part(answer.platform, 2), part(answer.tool, 1), part(answer.tool, 2)];
    const [first, along1, second, spindle] = [0, 1, 2, 3].map(i => part(answer.wrist, i));
    const r = 0.22 * this.size();
    const tip = answer.tip;
    const reach = norm(subtract(tip, spindle));
    const colour = name => this.at("tool", name);
    this.bar(first, subtract(along1, times(w, 1.3 * r)), 1.35 * r, colour("wrist"));
    this.bar(subtract(along1, times(w, 1.3 * r)), along1, r, colour("wrist"));
    if (norm(subtract(second, along1)) > 1e-6) this.bar(along1, second, 0.9 * r, colour("wrist"));
    this.bar(subtract(second, times(y, 1.15 * r)), add(second, times(y, 1.15 * r)), r, colour("arm"));
    this.bar(second, spindle, 0.8 * r, colour("arm"));
    const on = s => add(spindle, times(z, s * reach));
    this.bar(on(-0.5), on(0.42), 0.72 * r, colour("spindle"));
    this.bar(on(0.42), on(0.6), 0.72 * r, colour("spindle"), Mesh.taper);
    this.bar(on(0.6), on(0.92), 0.2 * r, "bit");
    this.bar(on(0.92), tip, 0.2 * r, "bit", Mesh.cone);
    if (this.layers.names) this.label(along1, "β1");
  }

  // -- what is asked of it --

  frames(answer) {
    const s = 0.6 * this.size();
    const frame = (at, axes, names) => axes.forEach((axis, i) => {
      this.arrow(at, add(at, times(axis, s)), 0.018 * this.size(), ["x", "y", "z"][i]);
      this.label(add(at, times(axis, 1.16 * s)), names[i]);
    });
    const off = [0, 0, 0];
    frame(off, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], ["x", "y", "z"]);
    frame(answer.a, [0, 1, 2].map(i => part(answer.platform, i)), ["u", "v", "w"]);
  }

  load(answer, wrench) {
    const force = turned(answer.tool, wrench.slice(0, 3)), moment = turned(answer.tool, wrench.slice(3));
    const s = this.size();
    const length = size => s * (0.35 + 0.9 * size / (size + 600));
    if (norm(force) > 0) {
      const from = subtract(answer.tip, times(unit(force), length(norm(force))));
      this.arrow(from, answer.tip, 0.028 * s, "load");
      this.label(from, `${+norm(force).toPrecision(4)} N`, "load");
    }
    if (norm(moment) > 0) {
      const axis = unit(moment), to = add(answer.tip, times(axis, 0.5 * s));
      this.arrow(answer.tip, to, 0.018 * s, "load");
      this.arrow(answer.tip, subtract(to, times(axis, 0.09 * s)), 0.018 * s, "load");
      this.label(to, `${+norm(moment).toPrecision(4)} N·m`, "load");
    }
  }

  /** The platform and what it carries, moved `scale` times as far as the load moves it. */
  deflected(answer, form, scale) {
    this.alpha = 0.38;
    this.hue = "deflected";
    this.moved = p => {
      const arm = subtract(p, answer.a);
      return add(p, times(add(form.a, cross(form.a_turn, arm)), scale));
    };
    this.platform(answer);
    this.wrist(answer);
    const to = this.moved(answer.tip);
    this.alpha = 1;
    this.hue = null;
    this.moved = p => p;
    this.arrow(answer.tip, to, 0.016 * this.size(), "deflected");
    this.label(to, `${(1e6 * norm(form.tip)).toPrecision(3)} µm`, "deflected");
  }

  ellipsoid(at, matrix, scale, colour) {
    if (!matrix.some(v => v)) return;
    this.alpha = 0.42;
    this.body(Mesh.sphere, affine(...[0, 1, 2].map(i => times(part(matrix, i), scale)), at), colour);
    this.alpha = 1;
  }
}
