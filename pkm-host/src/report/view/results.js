// What the core says, in numbers.

const FORM_NAMES = [["basic", "K_p"], ["diagonal", "Diagonal"], ["factor", "Factor"]];

/** With so many digits, and a minus sign. */
const fixed = (v, digits) => v.toFixed(digits).replace("-", "−");

class Results {
  constructor(data, state, update) {
    this.data = data;
    this.state = state;
    this.cells = {};
    const body = byId("result-body");
    this.headline = element("p", { class: "headline", id: "deflection" });
    this.parts = element("p", { class: "soft" });
    body.append(this.headline, this.parts, this.table(update), this.distances(), this.command());
  }

  /** K_p, diagonal and factor form side by side; the head of a column chooses the form that is drawn. */
  table(update) {
    const { data: { table }, state } = this;
    const missing = [false, !table, !table?.has_factor];
    const head = element("tr", {}, element("td"));
    FORM_NAMES.forEach(([, name], n) => {
      const input = element("input", { type: "radio", name: "form", value: n, checked: n === state.form, disabled: missing[n],
        onchange: () => { state.form = n; update(); } });
      head.append(element("th", { scope: "col" }, element("label", {}, input, element("span", {}, name))));
    });
    head.append(element("th", { scope: "col" }, "Unit"));
    const rows = [1, 2, 3, 4, 5, 6].map(i => [`k${i}${i}`, i < 4 ? "N/µm" : "N·m/mrad"]);
    rows.push(["Tip", "µm"], ["x", "µm"], ["y", "µm"], ["z", "µm"], ["Turn", "µrad"]);
    const bodyRows = rows.map(([name, unit]) => {
      this.cells[name] = FORM_NAMES.map(() => element("td"));
      return element("tr", {}, element("th", { scope: "row" }, name), ...this.cells[name], element("td", { class: "unit" }, unit));
    });
    this.notes = element("p", { class: "soft" });
    return element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Stiffness and deflection by form" },
      element("table", {}, element("caption", {}, "Stiffness at A, deflection of the tip in B. The form that is chosen is drawn."),
        element("thead", {}, head), element("tbody", {}, ...bodyRows)), this.notes);
  }

  distances() {
    const rows = [["share", "Five axes, normalised determinant"], ["limbs", "Singularity, limbs 1 and 2"], ["limb3", "Singularity, limb 3"],
      ["travel", "To the end of travel"]];
    this.meters = {};
    const list = element("dl", { class: "meters" });
    for (const [name, text] of rows) {
      const meter = element("meter", { min: 0, max: 1, "aria-label": text });
      const value = element("span");
      this.meters[name] = { meter, value };
      list.append(element("dt", {}, text), element("dd", {}, meter, value));
    }
    this.meters.share.meter.low = this.data.machine.margin;
    return list;
  }

  command() {
    this.commandRow = element("p", { id: "command" });
    return element("div", {}, element("h3", {}, "Command that makes up for the load"), this.commandRow);
  }

  show(answer, configuration) {
    const shown = answer[FORM_NAMES[this.state.form][0]];
    const micro = v => 1e6 * v;
    if (shown.ok[0]) {
      this.headline.textContent = `Tip moves by ${micro(norm(shown.tip)).toFixed(2)} µm`;
      this.parts.textContent = `in B: ${["x", "y", "z"].map((n, i) => `${n} ${fixed(micro(shown.tip[i]), 2)}`).join(", ")} µm; ` +
        `it turns by ${micro(norm(shown.turn)).toFixed(1)} µrad`;
    } else {
      this.headline.textContent = "No deflection";
      this.parts.textContent = shown.text;
    }
    FORM_NAMES.forEach(([name], n) => this.column(n, answer[name]));
    this.notes.textContent = FORM_NAMES.map(([name, text], n) => answer[name].text && (this.data.table || !n) ? `${text}: ${answer[name].text}. ` : "").join("");
    this.showDistances(answer);
    this.showCommand(answer, configuration);
  }

  column(n, form) {
    const write = (name, text) => {
      const cell = this.cells[name][n];
      cell.textContent = form.ok[0] ? text : "–";
      cell.classList.toggle("chosen", n === this.state.form);
    };
    for (let i = 0; i < 6; i++) write(`k${i + 1}${i + 1}`, fixed(form.k[7 * i] / (i < 3 ? 1e6 : 1e3), 2));
    write("Tip", (1e6 * norm(form.tip)).toFixed(3));
    ["x", "y", "z"].forEach((name, i) => write(name, fixed(1e6 * form.tip[i], 3)));
    write("Turn", (1e6 * norm(form.turn)).toFixed(2));
  }

  showDistances(answer) {
    const set = (name, value, text, most = 1) => {
      const { meter, value: shown } = this.meters[name];
      meter.max = most;
      meter.value = clamp(value, 0, most);
      shown.textContent = text;
    };
    set("share", answer.share[0], `${answer.share[0].toFixed(3)} (at least ${this.data.machine.margin})`, 1.5);
    set("limbs", answer.singularity[0], answer.singularity[0].toFixed(3));
    set("limb3", answer.singularity[1], answer.singularity[1].toFixed(3));
    const [least, most] = this.data.machine.travel_m;
    set("travel", answer.margin[0], `${(1e3 * answer.margin[0]).toFixed(1)} mm, limb ${answer.margin[1]}`, (most[0] - least[0]) / 2);
  }

  showCommand(answer, configuration) {
    if (!answer.compensated[0]) {
      this.commandRow.textContent = `None: ${answer.command_text}.`;
      return;
    }
    const signed = (v, digits) => (v < 0 ? "" : "+") + fixed(v, digits);
    const lengths = answer.command_lengths.map((q, i) => `q${i + 1} ${(1e3 * q).toFixed(4)} mm (${signed(1e6 * (q - answer.lengths[i]), 1)} µm)`);
    const angles = [3, 4].map(i => `β${i - 2} ${fixed(answer.command[i] * 180 / Math.PI, 4)}° (${signed(1e6 * (answer.command[i] - configuration[i]), 1)} µrad)`);
    const by = this.state.form === 2 ? "by the factor form" : "by K_p";
    this.commandRow.textContent = `${[...lengths, ...angles].join(", ")}; ${by}.`;
  }
}

/** Effects and elements, on and off, with their amplitudes. */
class Physics {
  /** `changed` gets the machine's numbers and gives a text where the core refuses them. */
  constructor(data, changed) {
    this.numbers = [...data.machine.numbers];
    this.changed = changed;
    this.message = element("p", { role: "alert" });
    const per = 6, { effects, elements, element_numbers } = data.layout;
    const own = [], others = [];
    data.effects.forEach((effect, n) => {
      const at = effects + per * n;
      const active = effect.parameters.some((_, i) => this.numbers[at + i] !== 0);
      (active ? own : others).push(this.item(effect.id, effect.parameters, at, active));
    });
    data.machine.elements.forEach((e, n) => {
      own.push(this.item(`${e.place}, ${e.motion}, ${e.law}`, e.parameters, elements + element_numbers * n + 3, true));
    });
    const body = byId("model-body");
    body.append(element("p", { class: "soft" }, "Amplitudes are in SI, as in the machine file. Nothing is written: they hold on this page."), this.message);
    if (own.length) body.append(element("h3", {}, "Of this machine"), ...own);
    body.append(element("h3", {}, own.length ? "Others" : "Effects, all off"), ...others,
      element("button", { type: "button", onclick: () => { body.replaceChildren(); new Physics(data, changed).take(); } }, "As in the machine file"));
  }

  item(name, parameters, at, active) {
    const kept = parameters.map((_, i) => this.numbers[at + i]);
    const inputs = parameters.map((parameter, i) => {
      const input = element("input", { type: "number", step: "any", value: kept[i], disabled: !active, "aria-label": `${name}: ${parameter}`,
        onchange: () => { kept[i] = input.valueAsNumber || 0; this.numbers[at + i] = kept[i]; this.take(); } });
      return element("label", { class: "amplitude" }, element("span", {}, parameter), input);
    });
    const toggle = checkbox(name, active, on => {
      parameters.forEach((parameter, i) => {
        // what was never given gets a size that shows
        if (on && kept.every(v => v === 0) && i === 0) kept[0] = Physics.typical(parameter);
        this.numbers[at + i] = on ? kept[i] : 0;
        const input = inputs[i].lastElementChild;
        input.disabled = !on;
        input.value = kept[i];
      });
      this.take();
    });
    return element("div", { class: "effect" }, toggle, ...inputs);
  }

  static typical(parameter) {
    const sizes = [["per_nm", 1e-7], ["per_n", 2e-9], ["per_k", 1e-5], ["_n", 500], ["_m", 1e-5]];
    return (sizes.find(([end]) => parameter.endsWith(end)) ?? ["", 1e-9])[1];
  }

  take() {
    const refused = this.changed(this.numbers);
    this.message.textContent = refused ? `Refused: ${refused}. The former machine is shown.` : "";
  }
}
