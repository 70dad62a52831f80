// Rows of a slider and a number, and other parts of the panel.

/** An element with attributes, handlers (`onclick`) and children. */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value != null) made.setAttribute(key, value);
  }
  made.append(...children.filter(c => c != null));
  return made;
}

const byId = id => document.getElementById(id);
let rowsMade = 0;

/** A quantity: a slider and a number with its unit. `changed` gets the number. */
class Row {
  constructor({ label, unit, low, high, step, digits, changed }) {
    const id = `row-${++rowsMade}`;
    this.digits = digits;
    this.slider = element("input", { type: "range", min: low, max: high, step: "any", "aria-label": `${label}, slider` });
    this.number = element("input", { type: "number", id, step, inputmode: "decimal", "aria-describedby": `${id}-unit` });
    this.slider.addEventListener("input", () => changed(+this.slider.value));
    // any step of the arrow keys on a slider without steps would be a hundredth of its range
    this.slider.addEventListener("keydown", event => {
      const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
      if (!way) return;
      event.preventDefault();
      changed(clamp(+this.slider.value + way * step, low, high));
    });
    this.number.addEventListener("change", () => {
      if (Number.isFinite(this.number.valueAsNumber)) changed(this.number.valueAsNumber);
      else this.show(this.value);
    });
    this.element = element("div", { class: "row" }, element("label", { for: id }, label), this.slider, this.number,
      element("span", { class: "unit", id: `${id}-unit` }, unit));
  }

  show(value) {
    this.value = value;
    this.slider.value = value;
    // what is being typed is left alone
    if (document.activeElement !== this.number || this.number.value === "" || +this.number.value !== +value.toFixed(this.digits)) {
      this.number.value = value.toFixed(this.digits);
    }
  }
}

/** Buttons of which one is down. */
function segmented(name, legend, options, chosen, changed) {
  const set = element("fieldset", { class: "segmented" }, element("legend", { class: "hidden" }, legend));
  for (const [value, text] of options) {
    const input = element("input", { type: "radio", name, value, checked: value === chosen, onchange: () => changed(value) });
    set.append(element("label", {}, input, element("span", {}, text)));
  }
  return set;
}

function checkbox(text, checked, changed) {
  const input = element("input", { type: "checkbox", checked, onchange: () => changed(input.checked) });
  return element("label", { class: "check" }, input, element("span", {}, text));
}

/** Position by pose, tip or joints. */
class Position {
  constructor(data, drive) {
    const degree = Math.PI / 180;
    const { box, travel_m, wrist_rad } = data.machine;
    const wide = ([low, high], by) => [low - by * (high - low), high + by * (high - low)];
    const angle = (label, [low, high], changed) => new Row({ label, unit: "°", low, high, step: 0.1, digits: 3, changed });
    const length = (label, [low, high], changed) => new Row({ label, unit: "mm", low, high, step: 1, digits: 3, changed });
    const pose = i => value => { this.values.configuration[i] = i === 2 ? value / 1e3 : value * degree; drive.pose(this.values.configuration); };
    const tip = i => value => { this.values.tip[i] = value / 1e3; drive.tip(this.values.tip, this.values.configuration.slice(3)); };
    const joint = i => value => { this.values.lengths[i] = value / 1e3; drive.joints(this.values.lengths, this.values.configuration.slice(3)); };
    const reach = 1.3 * (data.machine.home[2] + 0.6);
    const travel = i => [1e3 * travel_m[0][i], 1e3 * Math.min(travel_m[1][i], 10 * travel_m[0][i] + 10)];
    this.groups = {
      pose: [angle("θ", wide(box.theta_deg, 0.5), pose(0)), angle("σ", wide(box.sigma_deg, 0.5), pose(1)),
        length("Z0", wide(box.z0_mm, 1), pose(2))],
      tip: [length("x", [-500 * reach, 500 * reach], tip(0)), length("y", [-500 * reach, 500 * reach], tip(1)),
        length("z", [0, 1000 * reach], tip(2))],
      joints: [0, 1, 2].map(i => length(`q${i + 1}`, travel(i), joint(i))),
    };
    const beta = i => angle(`β${i + 1}`, [0, 1].map(end => wrist_rad[end][i] / degree), value => {
      this.values.configuration[3 + i] = value * degree;
      const angles = this.values.configuration.slice(3);
      if (this.mode === "tip") drive.tip(this.values.tip, angles);
      else drive.pose(this.values.configuration);
    });
    this.wrist = [beta(0), beta(1)];
    this.mode = "pose";
    const lists = Object.entries(this.groups).map(([mode, rows]) => [mode, element("div", { hidden: mode !== this.mode }, ...rows.map(r => r.element))]);
    const modes = [["pose", "Pose"], ["tip", "Tool tip"], ["joints", "Screws"]];
    byId("position-rows").append(
      segmented("position", "Position by", modes, this.mode, mode => {
        this.mode = mode;
        for (const [name, list] of lists) list.hidden = name !== mode;
      }),
      ...lists.map(([, list]) => list), ...this.wrist.map(r => r.element),
      element("div", { class: "buttons" }, element("button", { type: "button", onclick: () => drive.pose(data.machine.home) }, "Home")));
  }

  show(configuration, answer) {
    const degree = 180 / Math.PI;
    this.values = { configuration: [...configuration], tip: [...answer.tip], lengths: [...answer.lengths] };
    const [theta, sigma, z0, beta1, beta2] = configuration;
    [theta * degree, sigma * degree, z0 * 1e3].forEach((v, i) => this.groups.pose[i].show(v));
    answer.tip.forEach((v, i) => this.groups.tip[i].show(1e3 * v));
    answer.lengths.forEach((v, i) => this.groups.joints[i].show(1e3 * v));
    [beta1, beta2].forEach((v, i) => this.wrist[i].show(v * degree));
  }
}

/** The load, the temperature, and how far the deflection is drawn. */
class Load {
  constructor(data, state, update) {
    const rows = [["Fx", "N", 500], ["Fy", "N", 500], ["Fz", "N", 1000], ["Mx", "N·m", 50], ["My", "N·m", 50], ["Mz", "N·m", 50]];
    this.state = state;
    this.rows = rows.map(([label, unit, most], i) => new Row({
      label, unit, low: -most, high: most, step: unit === "N" ? 10 : 1, digits: 1,
      changed: value => { state.wrench[i] = value; update(); },
    }));
    this.temperature = new Row({
      label: "Temperature", unit: "°C", low: 0, high: 60, step: 1, digits: 1, changed: value => { state.temperature = value; update(); },
    });
    const scales = [["0", "so that it can be seen"], ...[100, 300, 1000, 3000, 10000, 30000].map(s => [String(s), `× ${s}`])];
    const select = element("select", { id: "scale", onchange: () => { state.scale = +select.value; update(); } },
      ...scales.map(([value, text]) => element("option", { value }, text)));
    byId("load-rows").append(...this.rows.slice(0, 3).map(r => r.element),
      element("details", {}, element("summary", {}, "Moments and temperature"),
        ...this.rows.slice(3).map(r => r.element), this.temperature.element),
      element("div", { class: "row" }, element("label", { for: "scale" }, "Drawn"), select));
  }

  show() {
    this.rows.forEach((row, i) => row.show(this.state.wrench[i]));
    this.temperature.show(this.state.temperature);
  }
}
