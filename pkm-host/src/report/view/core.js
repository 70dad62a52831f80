// The machine's own model: the core as WebAssembly. Every number of mechanics on this page comes from here.

class Core {
  static async load(base64, layout) {
    const bytes = Uint8Array.from(atob(base64), c => c.charCodeAt(0));
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Core(instance.exports, layout);
  }

  constructor(module, layout) {
    this.module = module;
    this.layout = layout;
    this.length = layout.answer.reduce((sum, [, length]) => sum + length, 0);
  }

  put(...parts) {
    const numbers = parts.flat();
    new Float64Array(this.module.memory.buffer, this.module.input(), numbers.length).set(numbers);
  }

  text(number = 0) {
    const { memory, text, text_length } = this.module;
    return new TextDecoder().decode(new Uint8Array(memory.buffer, text(number), text_length(number)).slice());
  }

  taken(length) {
    return Array.from(new Float64Array(this.module.memory.buffer, this.module.output(), length));
  }

  /** Takes a machine in; a text where the core refuses it. */
  machine(numbers) {
    this.put(numbers);
    return this.module.machine() ? null : this.text();
  }

  table(numbers) {
    this.put(numbers);
    return this.module.table() ? null : this.text();
  }

  /** Everything about a configuration under a load: parts by name, or a text where the machine cannot stand there. */
  solve({ configuration, wrench, temperature, form }) {
    this.put(configuration, wrench, temperature, form);
    if (!this.module.solve()) return { text: this.text() };
    const numbers = this.taken(this.length);
    const answer = this.named(numbers, this.layout.answer);
    ["basic", "diagonal", "factor"].forEach((name, n) => {
      answer[name] = Object.assign(this.named(answer[name], this.layout.form), { text: this.text(1 + n) });
    });
    answer.command_text = this.text(4);
    return answer;
  }

  named(numbers, layout) {
    const parts = {};
    let at = 0;
    for (const [name, length] of layout) {
      parts[name] = numbers.slice(at, at += length);
    }
    return parts;
  }

  configuration(done) {
    return done ? { configuration: this.taken(5) } : { text: this.text() };
  }

  /** The configuration of screw lengths. */
  forward(lengths, beta) {
    this.put(lengths, beta);
    return this.configuration(this.module.forward());
  }

  /** The configuration of a tip, the wrist's joints held. */
  tip(tip, beta) {
    this.put(tip, beta);
    return this.configuration(this.module.tip());
  }

  /** The configuration of a tip and an axis near another configuration. */
  tool(tip, axis, near) {
    this.put(tip, axis, near);
    return this.configuration(this.module.tool());
  }

  /** The configuration that has A in a place, or beside it: A stays in its plane. */
  platform(place, near) {
    this.put(place, near);
    return this.configuration(this.module.platform());
  }

  /** Takes poses into the checksum; its digits. */
  sweep(from, to) {
    return BigInt.asUintN(64, this.module.sweep(from, to)).toString(16).padStart(16, "0");
  }
}
