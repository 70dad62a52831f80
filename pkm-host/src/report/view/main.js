// Puts the page together: data, core, picture, panels.

class Page {
  constructor(data, core) {
    this.data = data;
    this.core = core;
    const form = data.table ? (data.table.has_factor ? 2 : 1) : 0;
    this.state = { configuration: [...data.machine.home], wrench: [120, 0, -400, 0, 0, 5], temperature: 20, form, scale: 0 };
    this.scene = new Scene(data);
    this.scene.layers = Object.fromEntries(Object.entries(LAYERS).map(([name, [, on]]) => [name, on]));
    this.solve();
    this.camera = new Camera(...this.scene.extent(this.answer));
    const update = () => this.update();
    this.position = new Position(data, {
      pose: c => this.drive({ configuration: [...c] }),
      tip: (tip, beta) => this.drive(core.tip(tip, beta)),
      joints: (lengths, beta) => this.drive(core.forward(lengths, beta)),
    });
    this.load = new Load(data, this.state, update);
    this.results = new Results(data, this.state, update);
    new Physics(data, numbers => this.machine(numbers));
    this.layers();
    this.origin();
    this.picture();
    this.pointer = new Pointer(byId("picture"), {
      camera: this.camera, answer: () => this.answer, moved: () => this.redraw(),
      dragTip: to => this.toward(this.answer.tip, to, p => core.tip(p, this.state.configuration.slice(3))),
      dragPlatform: to => this.toward(this.answer.a, to, p => core.platform(p, this.state.configuration)),
    });
    this.documents = new Documents({
      data, core, camera: this.camera, redraw: update,
      pose: c => this.drive({ configuration: [...c] }),
      load: wrench => { this.state.wrench = [...wrench]; this.load.state.wrench = this.state.wrench; },
      solved: configuration => core.solve({ ...this.state, configuration }),
    });
    this.update();
  }

  // -- driving --

  /** Takes a configuration, if the machine can; else says why not and stays. */
  drive({ configuration, text }) {
    const before = this.state.configuration;
    if (configuration) this.state.configuration = configuration;
    const refused = text ?? this.solve();
    byId("refused").textContent = refused ? `Refused: ${refused}. The machine stays where it is.` : "";
    if (refused) {
      this.state.configuration = before;
      this.solve();
    }
    this.show();
  }

  /** As far on the straight way from a place to another as the machine gets. */
  toward(from, to, held) {
    let [near, far] = [0, 1];
    let best = held(to);
    for (let n = 0; best.text && n < 8; n++) {
      const middle = (near + far) / 2;
      const tried = held(add(from, times(subtract(to, from), middle)));
      if (tried.text) far = middle;
      else {
        near = middle;
        this.state.configuration = tried.configuration;
      }
      if (n === 7) best = { configuration: this.state.configuration, said: best.text };
    }
    this.drive(best);
    if (best.said) byId("refused").textContent = `End of the way: ${best.said}.`;
  }

  machine(numbers) {
    const refused = this.core.machine(numbers);
    if (!refused) {
      this.boxEdges = null;
      this.update();
    }
    return refused;
  }

  // -- answers --

  solve() {
    const answer = this.core.solve(this.state);
    if (answer.text) return answer.text;
    this.answer = answer;
    return null;
  }

  update() {
    const refused = this.solve();
    byId("refused").textContent = refused ? `Refused: ${refused}.` : "";
    this.show();
  }

  show() {
    if (!this.answer) return;
    this.position.show(this.state.configuration, this.answer);
    this.load.show();
    this.results.show(this.answer, this.state.configuration);
    const state = byId("state");
    const inside = this.answer.inside[0] === 1;
    state.textContent = !this.data.table ? "Basic model, no table" : inside ? "Inside the table's box" : "Outside the table's box: extrapolated";
    state.className = `state ${!this.data.table ? "plain" : inside ? "good" : "warning"}`;
    this.redraw();
  }

  // -- picture --

  picture() {
    const canvas = byId("picture");
    try {
      this.renderer = new Renderer(canvas);
      this.renderer.restored = () => this.redraw();
    } catch (error) {
      byId("legend").textContent = error.message;
    }
    document.querySelectorAll("[data-look]").forEach(button => button.addEventListener("click", () => { this.camera.look(button.dataset.look); this.redraw(); }));
    new ResizeObserver(() => this.redraw()).observe(canvas);
    const theme = matchMedia("(prefers-color-scheme: dark)");
    theme.addEventListener("change", () => { this.paper = null; this.redraw(); });
    addEventListener("beforeprint", () => this.print());
    addEventListener("afterprint", () => { byId("printed")?.remove(); this.paper = null; this.redraw(); });
  }

  /** Paper gets the picture as it is, since a canvas may be cleared by then. */
  print() {
    this.paper = null;
    this.draw();
    byId("printed")?.remove();
    byId("stage").prepend(element("img", { id: "printed", alt: "The machine", src: byId("picture").toDataURL() }));
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }

  /** Colours as the style sheet has them. */
  palette() {
    const style = getComputedStyle(byId("stage"));
    const rgb = name => (style.getPropertyValue(`--${name}`).trim().match(/[0-9a-f]{2}/gi) ?? ["80", "80", "80"]).map(h => parseInt(h, 16) / 255);
    const names = ["base", "limb1", "limb2", "limb3", "ram", "drive", "joint", "platform", "wrist", "arm", "spindle", "bit", "found", "load", "deflected",
      "ellipsoid", "x", "y", "z", "edge", "read", "before", "after", "slab", "handle"];
    this.scene.colours = Object.fromEntries(names.map(name => [name, rgb(name)]));
    this.paper = rgb("stage");
  }

  draw() {
    if (!this.answer) return;
    const { scene, answer, state } = this;
    if (!this.paper) this.palette();
    const canvas = byId("picture");
    // on paper the canvas has no size: the picture is that of the screen
    if (canvas.clientWidth) this.camera.size = [canvas.clientWidth, canvas.clientHeight];
    scene.begin();
    scene.found = this.documents?.found;
    scene.machine(answer);
    const said = this.additions(scene, answer, state);
    byId("legend").textContent = said.join(" · ");
    this.frames = (this.frames ?? 0) + 1;
    if (!this.renderer) return;
    this.renderer.resize();
    this.renderer.draw(this.camera, scene, this.paper);
    this.label(scene.labels);
  }

  /** What is drawn beside the machine; in words, with the scales. */
  additions(scene, answer, state) {
    const said = [];
    const form = answer[FORM_NAMES[state.form][0]];
    const { layers } = scene;
    if (layers.frames) scene.frames(answer);
    const reading = this.documents?.drawReading(scene, answer);
    if (reading) said.push(reading);
    else scene.load(answer, state.wrench);
    const moved = Math.max(norm(form.tip), norm(form.a));
    if (!reading && layers.deflection && form.ok[0] && moved > 0) {
      const scale = state.scale || niceBelow(0.3 * scene.size() / moved);
      scene.deflected(answer, form, scale);
      said.push(`deflection × ${scale.toLocaleString("en")}`);
    }
    if (form.ok[0]) said.push(...this.ellipsoids(scene, answer));
    if (layers.box && this.data.table) {
      this.box(scene);
      said.push("grey lines: edges of the table's box, as far as the machine reaches");
    }
    this.documents?.drawHoles(scene);
    this.documents?.drawPath(scene);
    scene.handle(answer.tip);
    scene.handle(answer.a);
    return said;
  }

  /** One scale for both, and the same wherever the machine goes, so that sizes compare. */
  ellipsoids(scene, answer) {
    const { layers } = scene;
    if (!layers.ellipsoid_a && !layers.ellipsoid_tip) return [];
    const radius = m => Math.max(...[0, 1, 2].map(i => norm(part(m, i))));
    this.compliance ||= niceBelow(0.45 * scene.size() / Math.max(radius(answer.ellipsoid_tip), 1e-15));
    if (layers.ellipsoid_a) scene.ellipsoid(answer.a, answer.ellipsoid_a, this.compliance, "ellipsoid");
    if (layers.ellipsoid_tip) scene.ellipsoid(answer.tip, answer.ellipsoid_tip, this.compliance, "ellipsoid");
    return [`ellipsoid: 100 mm is ${+(1e5 / this.compliance).toPrecision(3)} µm/N`];
  }

  /** Edges of the table's box, as the tip sees them with the wrist held. */
  box(scene) {
    const beta = this.state.configuration.slice(3);
    const key = beta.join();
    if (this.boxEdges?.key !== key) {
      const { theta_deg, sigma_deg, z0_mm } = this.data.table.box;
      const ranges = [theta_deg.map(degrees), sigma_deg.map(degrees), z0_mm.map(v => v / 1e3)];
      const runs = [];
      for (let axis = 0; axis < 3; axis++) {
        for (let corner = 0; corner < 4; corner++) {
          const run = [];
          for (let n = 0; n <= 12; n++) {
            const pose = [0, 1, 2].map(i => i === axis ? ranges[i][0] + (ranges[i][1] - ranges[i][0]) * n / 12
              : ranges[i][corner >> ((i - axis + 3) % 3 - 1) & 1]);
            const { tip } = this.core.solve({ ...this.state, configuration: [...pose, ...beta] });
            if (tip) run.push(tip);
          }
          if (run.length > 1) runs.push(run);
        }
      }
      this.boxEdges = { key, runs };
    }
    for (const run of this.boxEdges.runs) scene.line(run, "edge");
  }

  label(labels) {
    const holder = byId("labels");
    while (holder.children.length < labels.length) holder.append(element("span"));
    const taken = [];
    [...holder.children].forEach((span, n) => {
      const label = labels[n];
      span.hidden = !label;
      if (!label) return;
      let [x, y] = this.camera.project(label.at);
      // a label that would lie on another goes below it
      const half = 6 + 4 * label.text.length;
      const clash = () => taken.find(t => Math.abs(t.x - x) < t.half + half && Math.abs(t.y - y) < 17);
      for (let other = clash(); other && taken.length < 60; other = clash()) y = other.y + 17.5;
      taken.push({ x, y, half });
      span.className = label.kind;
      span.textContent = label.text;
      span.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
    });
  }

  // -- panels --

  layers() {
    byId("shown-body").append(...Object.entries(LAYERS).map(([name, [text, on]]) =>
      checkbox(text, on, checked => { this.scene.layers[name] = checked; this.redraw(); })));
    const warnings = byId("warnings");
    warnings.hidden = !this.data.warnings.length;
    warnings.append(...this.data.warnings.map(w => element("p", { class: "warning" }, `⚠ ${w}`)));
  }

  origin() {
    const { machine, table, program, core_sha256 } = this.data;
    const facts = [["Program", program], ["Machine", `${machine.name}, ${machine.file}, SHA-256 ${machine.sha256}`],
      ["Table", table ? `${table.file}, SHA-256 ${table.sha256}` : "none"], ["Core as WebAssembly", `SHA-256 ${core_sha256}`]];
    byId("origin-body").append(...facts.flatMap(([name, text]) => [element("dt", {}, name), element("dd", {}, text)]));
  }

  /** Compares results over the fixed poses with the program's, a few at a time. The machine is the one of the file meanwhile. */
  async compare() {
    const { poses, value } = this.data.checksum;
    const shown = byId("checksum");
    let sum = "";
    const core = await Core.load(byId("core").textContent, this.data.layout);
    core.machine(this.data.machine.numbers);
    if (this.data.table) core.table(this.data.table.numbers);
    for (let n = 0; n < poses; n += 250) {
      sum = core.sweep(n, Math.min(n + 250, poses));
      await new Promise(next => setTimeout(next));
    }
    const equal = sum === value;
    shown.className = `state ${equal ? "good" : "bad"}`;
    shown.textContent = equal ? `${poses.toLocaleString("en")} poses as ${this.data.program.split(" ")[0]}: ${sum}` : `Differs from the program: ${sum}, not ${value}`;
    shown.title = "Checksum over every bit of the results at these poses, here and in the program that wrote this page";
  }
}

(async () => {
  const data = JSON.parse(byId("data").textContent);
  try {
    const core = await Core.load(byId("core").textContent, data.layout);
    const refused = core.machine(data.machine.numbers) ?? (data.table && core.table(data.table.numbers));
    if (refused) throw new Error(refused);
    window.pkm = new Page(data, core);
  } catch (error) {
    byId("state").textContent = `The page cannot compute: ${error.message}`;
    byId("state").className = "state bad";
    return;
  }
  await new Promise(next => requestAnimationFrame(() => setTimeout(next)));
  await window.pkm.compare();
})();
