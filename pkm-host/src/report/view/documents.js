// A diagnosis, a placement and a path: from this page's data, or from files that are opened here.

const degrees = v => v * Math.PI / 180;

/** Buttons and a slider that go through a list. */
class Stepper {
  constructor(name, count, show) {
    this.count = count;
    this.show = show;
    this.at = 0;
    this.slider = element("input", { type: "range", min: 1, max: count, step: 1, value: 1, "aria-label": `${name}, number`,
      oninput: () => this.go(+this.slider.value - 1) });
    this.text = element("span", { class: "count" });
    const button = (text, label, by) => element("button", { type: "button", "aria-label": `${label} ${name.toLowerCase()}`, onclick: () => this.go(this.at + by) }, text);
    this.element = element("div", { class: "stepper" }, button("‹", "Previous", -1), this.slider, button("›", "Next", 1), this.text);
  }

  go(n) {
    this.at = clamp(n, 0, this.count - 1);
    this.slider.value = this.at + 1;
    this.text.textContent = `${this.at + 1} of ${this.count}`;
    this.show(this.at);
  }
}

function grid(caption, heads, rows) {
  return element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption }, element("table", {}, element("caption", {}, caption),
    element("thead", {}, element("tr", {}, ...heads.map((h, i) => i ? element("th", { scope: "col" }, h) : element("td")))),
    element("tbody", {}, ...rows.map(([name, ...cells]) => element("tr", {}, element("th", { scope: "row" }, name), ...cells.map(c => element("td", {}, c)))))));
}

class Documents {
  /** `host` has data, core, pose(configuration), load(wrench), redraw(). */
  constructor(host) {
    this.host = host;
    this.found = new Set();
    const { data } = host;
    if (data.diagnosis) this.diagnosis(data.diagnosis);
    if (data.placement) this.placement(data.placement);
    if (data.path) this.path(data.path);
    const file = byId("file");
    file.addEventListener("change", () => { for (const f of file.files) this.open(f); });
    document.addEventListener("dragover", e => e.preventDefault());
    document.addEventListener("drop", e => { e.preventDefault(); for (const f of e.dataTransfer.files) this.open(f); });
  }

  async open(file) {
    const message = byId("file-message");
    try {
      const text = await file.text();
      if (/\.csv$/i.test(file.name)) this.path(this.walked(file.name, text));
      else this.document(JSON.parse(text));
      message.textContent = `${file.name} is open.`;
      message.classList.remove("bad");
    } catch (error) {
      message.textContent = `${file.name}: ${error.message}`;
      message.classList.add("bad");
    }
  }

  document(json) {
    const own = this.host.data.machine;
    const is = key => Array.isArray(json?.[key]);
    if (!is("series") && !(is("effects") && is("readings"))) throw new Error("neither a diagnosis.json nor a placement.json of this version");
    if (![json.machine_sha256, json.identified_sha256].includes(own.sha256)) {
      throw new Error(`is of machine “${json.machine}”, from another machine file than ${own.file}`);
    }
    if (is("series")) this.placement(json);
    else this.diagnosis(json);
  }

  section(id) {
    const section = byId(id);
    section.replaceChildren();
    section.hidden = false;
    return section;
  }

  // -- diagnosis --

  diagnosis(json) {
    const section = this.section("diagnosis");
    this.found = new Set(json.effects.filter(e => e.of === "machine").flatMap(e => this.places(e)));
    const verdict = json.verdict.replaceAll("_", " ");
    section.append(element("h3", {}, `Diagnosis: ${verdict}`));
    for (const e of json.effects) {
      const amplitudes = Object.entries(e.parameters).map(([name, p]) => `${name} ${Number(p.value).toPrecision(3)}`).join(", ");
      section.append(element("p", { class: "finding" }, element("strong", {}, e.id), ` at ${e.where}${amplitudes ? `: ${amplitudes}` : ""}. Inspect: ${e.inspect}.`));
    }
    if (this.found.size) section.append(element("p", { class: "soft" }, element("span", { class: "key found" }), ` coloured in the picture: ${[...this.found].join(", ")}`));
    const { error_before: before, error_after: after } = json;
    if (before && after) section.append(element("p", {}, `Error of the translation, rms: ${before.linear_um_rms.toFixed(2)} µm before, ${after.linear_um_rms.toFixed(2)} µm after.`));
    if (!json.readings.length) return this.host.redraw();
    const table = element("div");
    const stepper = new Stepper("Reading", json.readings.length, n => {
      const reading = json.readings[n];
      this.reading = reading;
      table.replaceChildren(this.readingTable(reading));
      this.host.pose([degrees(reading.theta_deg), degrees(reading.sigma_deg), reading.z0_mm / 1e3, 0, 0]);
    });
    section.append(element("h4", {}, "Readings"), stepper.element, table,
      element("div", { class: "buttons" }, element("button", { type: "button", onclick: () => { this.reading = null; this.host.redraw(); } }, "Hide reading")));
    // the first is shown when somebody asks for it: it moves the machine
    stepper.text.textContent = `1 to ${json.readings.length}`;
    this.host.redraw();
  }

  places(effect) {
    const limb = /^limb-(\d)-axial$/.exec(effect.id);
    if (limb) return [`limb.${limb[1]}.body`];
    const joints = { "universal-joint": [1, 2], "revolute-joint": [1, 2], "spherical-joint": [3], "revolute3-joint": [3] };
    return [effect.where, ...effect.where_class].filter(place => /^(limb\.|moving_platform$|base$|tool$)/.test(place)).concat(
      joints[effect.id] && !effect.where.startsWith("limb.") ? joints[effect.id].map(i => `limb.${i}.base_joint`) : []);
  }

  readingTable(r) {
    const names = ["u", "v", "w", "about u", "about v", "about w"];
    const number = v => v == null ? "–" : v.toFixed(2);
    const list = r.gauge ? [["along the gauge", r.read[0], r.before[0], r.after[0]]] : names.map((name, i) => [name, r.read[i], r.before[i], r.after[i]]);
    return grid(`Line ${r.line}${r.excluded ? ", left out as a gross error" : ""}: µm and µrad at ${r.point_mm.join(", ")} mm`, ["", "Read", "Before", "After"],
      list.map(([name, ...values]) => [name, ...values.map(number)]));
  }

  /** Load and deflection of the reading that is shown, as arrows. */
  drawReading(scene, answer) {
    const r = this.reading;
    if (!r) return null;
    const inB = v => turned(answer.platform, v);
    const at = add(answer.a, inB(times(r.point_mm, 1e-3)));
    const s = scene.size();
    const force = inB(r.wrench.slice(0, 3));
    if (norm(force)) scene.arrow(subtract(at, times(unit(force), 0.8 * s)), at, 0.026 * s, "load");
    const vectors = [["read", r.read], ["before", r.before], ["after", r.after]]
      .map(([name, v]) => [name, inB(r.gauge ? times(r.gauge, v[0] ?? 0) : v.slice(0, 3).map(x => x ?? 0))]);
    const longest = Math.max(...vectors.map(([, v]) => norm(v)), 1e-9);
    const scale = niceBelow(0.9 * s / (longest * 1e-6));
    // side by side, so that three that agree are seen to
    const across = this.host.camera.axes().right;
    vectors.forEach(([name, v], n) => {
      const from = add(at, times(across, (n - 1) * 0.05 * s));
      const to = add(from, times(v, 1e-6 * scale));
      scene.arrow(from, to, 0.017 * s, name);
      scene.label(add(to, times(across, (n - 1) * 0.06 * s)), name, name);
    });
    return `reading × ${scale.toLocaleString("en")}`;
  }

  // -- placement --

  placement(json) {
    const section = this.section("placement");
    const options = json.series.map((s, n) => element("option", { value: n }, `${s.name}, ${s.objective}`));
    const select = element("select", { id: "series", onchange: () => choose(+select.value) }, ...options);
    const body = element("div");
    const choose = n => {
      const s = json.series[n];
      this.holes = s.holes.map(h => {
        const configuration = [degrees(h.theta_deg), degrees(h.sigma_deg), h.z0_mm / 1e3, degrees(h.beta1_deg), degrees(h.beta2_deg)];
        const answer = this.host.solved(configuration);
        return { ...h, configuration, tip: answer.tip, axis: answer.tool && part(answer.tool, 2) };
      });
      const stepper = new Stepper("Hole", s.holes.length, k => { this.hole = k; this.host.pose(this.holes[k].configuration); });
      stepper.text.textContent = `1 to ${s.holes.length}`;
      this.hole = null;
      const worst = this.holes.reduce((w, h) => Math.max(w, h.deflection_um ?? 0), 0);
      body.replaceChildren(
        element("p", {}, `Best at dx ${s.dx_mm.toFixed(1)} mm, dy ${s.dy_mm.toFixed(1)} mm, rotary axis ${s.rotary_deg.toFixed(1)}°: ${s.value.toPrecision(4)} ${s.unit}` +
          `${worst ? `; the worst hole gives by ${worst.toFixed(2)} µm` : ""}.`),
        stepper.element);
      this.host.redraw();
    };
    section.append(element("h3", {}, "Placement"), element("div", { class: "row" }, element("label", { for: "series" }, "Series"), select), body);
    choose(0);
  }

  drawHoles(scene) {
    const holes = (this.holes ?? []).filter(h => h.tip);
    if (!holes.length) return;
    const s = scene.size();
    const worst = Math.max(...holes.map(h => h.deflection_um ?? 0), 1e-9);
    holes.forEach((h, n) => {
      const back = add(h.tip, times(h.axis, 0.05 * s));
      const colour = n === this.hole ? "read" : (h.deflection_um ?? 0) > 0.8 * worst ? "before" : "after";
      scene.bar(subtract(h.tip, times(h.axis, 0.03 * s)), back, 0.06 * s, colour);
      scene.label(add(h.tip, times(h.axis, 0.12 * s)), String(n + 1), colour);
    });
    this.drawPlate(scene, holes, s);
  }

  /** The workpiece as a slab behind the holes, square to their mean axis. */
  drawPlate(scene, holes, s) {
    const axis = unit(holes.reduce((sum, h) => add(sum, h.axis), [0, 0, 0]));
    const [u, v] = sideways(axis);
    const middle = times(holes.reduce((sum, h) => add(sum, h.tip), [0, 0, 0]), 1 / holes.length);
    const far = d => Math.max(...holes.map(h => Math.abs(dot(subtract(h.tip, middle), d)))) + 0.2 * s;
    const behind = Math.max(...holes.map(h => dot(subtract(h.tip, middle), axis))) + 0.06 * s;
    const at = add(middle, times(axis, behind + 0.03 * s));
    this.slab ??= Mesh.plate([[-1, -1], [1, -1], [1, 1], [-1, 1]], 1e-3, 1);
    scene.body(this.slab, affine(times(u, far(u)), times(v, far(v)), times(axis, 0.05 * s), at), "slab");
  }

  // -- path --

  /** A path of a CSV: each row's tool held near the one before. */
  walked(name, text) {
    const lines = text.split(/\r?\n/).map((line, n) => [n + 1, line.trim()]).filter(([, line]) => line && !line.startsWith("#"));
    const heads = (lines.shift()?.[1] ?? "").split(",").map(h => h.trim());
    const columns = ["x_mm", "y_mm", "z_mm", "i", "j", "k", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"].map(c => heads.indexOf(c));
    if (columns.includes(-1)) throw new Error("expected the columns x_mm … k and fx_n … mz_nm, with commas between");
    let near = this.host.data.machine.home;
    const points = lines.map(([line, row]) => {
      const cells = row.split(",");
      const numbers = columns.map(c => cells[c]?.trim() ? Number(cells[c]) : NaN);
      if (!numbers.every(Number.isFinite)) throw new Error(`line ${line}: expected numbers`);
      const held = this.host.core.tool(times(numbers, 1e-3), numbers.slice(3, 6), near);
      if (held.text) throw new Error(`line ${line}: ${held.text}`);
      near = held.configuration;
      return [line, 0, near, numbers.slice(6)];
    });
    if (!points.length) throw new Error("no points");
    return { name, points };
  }

  path({ name, points }) {
    clearTimeout(this.timer);
    const section = this.section("path");
    this.track = points.map(([, rapid, configuration]) => ({ rapid, tip: this.host.solved(configuration).tip })).filter(p => p.tip);
    const stepper = new Stepper("Point", points.length, n => {
      const [line, , configuration, wrench] = points[n];
      where.textContent = `Line ${line}`;
      this.host.load(wrench);
      this.host.pose(configuration);
    });
    const where = element("p", { class: "soft" }, `${points.length} points`);
    const play = element("button", { type: "button", id: "play", "aria-pressed": "false", onclick: () => toggle(play.ariaPressed !== "true") }, "Play");
    const toggle = on => {
      play.ariaPressed = String(on);
      play.textContent = on ? "Pause" : "Play";
      clearTimeout(this.timer);
      if (on) step(stepper.at >= points.length - 1 ? 0 : stepper.at);
    };
    // who wants little motion gets a picture twice a second
    const still = matchMedia("(prefers-reduced-motion: reduce)");
    const step = n => {
      stepper.go(n);
      if (n >= points.length - 1) return toggle(false);
      const by = still.matches ? Math.max(1, Math.ceil(points.length / 40)) : Math.max(1, Math.ceil(points.length / 900));
      this.timer = setTimeout(() => step(Math.min(n + by, points.length - 1)), still.matches ? 500 : 16);
    };
    section.append(element("h3", {}, `Path ${name}`), stepper.element, where, element("div", { class: "buttons" }, play));
    stepper.text.textContent = `1 to ${points.length}`;
    this.host.redraw();
  }

  drawPath(scene) {
    let run = [];
    for (const { rapid, tip } of this.track ?? []) {
      if (rapid && run.length) {
        scene.line(run, "read");
        scene.line([run[run.length - 1], tip], "edge");
        run = [];
      }
      run.push(tip);
    }
    if (run.length > 1) scene.line(run, "read");
  }
}

/** The greatest of 1, 2, 5 times a power of ten that is not above. */
function niceBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [5, 2, 1].find(n => n * power <= value * 1.0001);
}
