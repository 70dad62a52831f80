// Vectors, matrices by column, and the camera. Geometry of the picture alone: the machine's is the core's.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = a => Math.hypot(a[0], a[1], a[2]);
const unit = a => times(a, 1 / (norm(a) || 1));
const part = (list, n) => [list[3 * n], list[3 * n + 1], list[3 * n + 2]];
// 3×3 by column, times a vector
const turned = (m, v) => [0, 1, 2].map(i => m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2]);
const clamp = (v, low, high) => Math.min(high, Math.max(low, v));

/** Two unit vectors square to a direction and to each other. */
function sideways(direction) {
  const [x, y, z] = direction.map(Math.abs);
  const other = x <= y && x <= z ? [1, 0, 0] : y <= z ? [0, 1, 0] : [0, 0, 1];
  const u = unit(cross(other, direction));
  return [u, cross(direction, u)];
}

/** 4×4 by column, from three columns and an origin. */
const affine = (x, y, z, o) => [...x, 0, ...y, 0, ...z, 0, ...o, 1];

/** A mesh of radius 1 along z from 0 to 1, stretched from one point to another. */
function along(from, to, radius) {
  const axis = subtract(to, from);
  const [u, v] = sideways(unit(axis));
  return affine(times(u, radius), times(v, radius), axis, from);
}

function multiply(a, b) {
  const c = new Array(16);
  for (let j = 0; j < 4; j++) {
    for (let i = 0; i < 4; i++) {
      c[4 * j + i] = a[i] * b[4 * j] + a[4 + i] * b[4 * j + 1] + a[8 + i] * b[4 * j + 2] + a[12 + i] * b[4 * j + 3];
    }
  }
  return c;
}

/** The convex hull of points [x, y], counter-clockwise. */
function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const turn = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
  const half = list => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1 && turn(chain[chain.length - 2], chain[chain.length - 1], p) <= 0) chain.pop();
      chain.push(p);
    }
    chain.pop();
    return chain;
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

/** Looks at a point from a distance. The base hangs above the tool, as in a machine tool: -z of B is up. */
class Camera {
  constructor(centre, size) {
    this.home = { centre, size };
    this.size = [1, 1];
    this.look("iso");
  }

  look(name) {
    const [yaw, pitch] = { iso: [-0.95, 0.32], front: [-Math.PI / 2, 0], side: [0, 0], top: [-Math.PI / 2, 1.5] }[name];
    Object.assign(this, { yaw, pitch, centre: this.home.centre, distance: 3.1 * this.home.size });
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = clamp(this.pitch + pitch, -1.5, 1.5);
  }

  zoom(factor) {
    this.distance = clamp(this.distance * factor, 0.2 * this.home.size, 12 * this.home.size);
  }

  /** Moves the centre by pixels. */
  shift(dx, dy) {
    const { right, up } = this.axes();
    const scale = this.pixel(this.centre);
    this.centre = add(this.centre, add(times(right, -dx * scale), times(up, dy * scale)));
  }

  axes() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const back = [cy * cp, sy * cp, -sp];
    const right = unit(cross([0, 0, -1], back));
    return { back, right, up: cross(back, right) };
  }

  eye() {
    return add(this.centre, times(this.axes().back, this.distance));
  }

  /** Width of a view of unit depth; wider where the window is narrow. */
  spread() {
    const [width, height] = this.size;
    const tan = 0.32 * Math.max(1, 0.8 * height / width);
    return { x: tan * width / height, y: tan };
  }

  /** From B into the window's cube. */
  matrix() {
    const { back, right, up } = this.axes();
    const eye = this.eye();
    const { x, y } = this.spread();
    const near = 0.05 * this.distance, far = 8 * this.home.size + 2 * this.distance;
    const turn = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const lens = [1 / x, 0, 0, 0, 0, 1 / y, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
    return multiply(lens, turn);
  }

  depth(point) {
    return dot(subtract(this.eye(), point), this.axes().back);
  }

  /** Metres a pixel at a point. */
  pixel(point) {
    return 2 * this.spread().y * this.depth(point) / this.size[1];
  }

  /** Where a point is in the window, in pixels. */
  project(point) {
    const { right, up } = this.axes();
    const from = subtract(point, this.eye());
    const scale = this.pixel(point);
    return [this.size[0] / 2 + dot(from, right) / scale, this.size[1] / 2 - dot(from, up) / scale];
  }

  /** The point at a pixel, as far away as another. */
  at(x, y, like) {
    const { right, up, back } = this.axes();
    const scale = this.pixel(like);
    const middle = subtract(this.eye(), times(back, this.depth(like)));
    return add(middle, add(times(right, (x - this.size[0] / 2) * scale), times(up, (this.size[1] / 2 - y) * scale)));
  }
}
