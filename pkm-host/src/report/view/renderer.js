// Draws a list of bodies and lines with WebGL. A body: { mesh, at (4×4), colour [r, g, b], alpha, front }; lines: { points, colour }.
//
// All bodies become one list of triangles, lit here: where a processor draws without help, calls cost more than corners.

const BODY_VERTEX = `
attribute vec3 position;
attribute vec4 colour;
uniform mat4 view;
varying lowp vec4 shade;
void main() { shade = colour; gl_Position = view * vec4(position, 1.0); }`;

const BODY_FRAGMENT = `
varying lowp vec4 shade;
void main() { gl_FragColor = shade; }`;

// lines are one pixel wide wherever; drawn again beside themselves they are wider
const LINE_VERTEX = `
attribute vec3 position;
uniform mat4 view;
uniform vec2 aside;
void main() { gl_Position = view * vec4(position, 1.0); gl_Position.xy += aside * gl_Position.w; }`;

const LINE_FRAGMENT = `
precision mediump float;
uniform vec4 colour;
void main() { gl_FragColor = colour; }`;

// a corner: three floats of its place, four bytes of its colour
const CORNER = 4;

/** Whether something else than the processor draws. Not every browser that leaves it to the processor counts that as a caveat. */
function isHelped() {
  const gl = document.createElement("canvas").getContext("webgl", { failIfMajorPerformanceCaveat: true });
  if (!gl) return false;
  let renderer = gl.getParameter(gl.RENDERER);
  // says nothing; where it says something the extension is not to be used
  if (renderer === "WebKit WebGL") {
    const named = gl.getExtension("WEBGL_debug_renderer_info");
    if (named) renderer = gl.getParameter(named.UNMASKED_RENDERER_WEBGL);
  }
  return !/swiftshader|llvmpipe|software/i.test(renderer);
}

class Renderer {
  /** Without WebGL there is nothing to draw with: an error. */
  constructor(canvas) {
    this.canvas = canvas;
    // a processor that draws without help has no time for smooth edges
    this.gl = canvas.getContext("webgl", { antialias: isHelped(), alpha: false, powerPreference: "low-power" });
    if (!this.gl?.getExtension("OES_element_index_uint")) {
      throw new Error("WebGL is not available: the picture is left out, the numbers are not");
    }
    canvas.addEventListener("webglcontextlost", event => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.prepare(); this.restored?.(); });
    this.prepare();
  }

  prepare() {
    const { gl } = this;
    gl.getExtension("OES_element_index_uint");
    this.body = this.program(BODY_VERTEX, BODY_FRAGMENT, ["view"]);
    this.line = this.program(LINE_VERTEX, LINE_FRAGMENT, ["view", "colour", "aside"]);
    [this.points, this.corners, this.triangles] = [gl.createBuffer(), gl.createBuffer(), gl.createBuffer()];
    this.room(1 << 13, 1 << 14);
    gl.enable(gl.DEPTH_TEST);
    gl.enableVertexAttribArray(0);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  program(vertex, fragment, uniforms) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "position");
    gl.bindAttribLocation(program, 1, "colour");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = {};
    for (const name of uniforms) places[name] = gl.getUniformLocation(program, name);
    return { program, places };
  }

  /** Memory for so many corners and indices. */
  room(corners, indices) {
    if (!(this.places?.length >= corners * CORNER)) {
      this.places = new Float32Array(corners * CORNER);
      this.colours = new Uint8Array(this.places.buffer);
    }
    if (!(this.indices?.length >= indices)) this.indices = new Uint32Array(indices);
  }

  /** Fits the picture to the window. */
  resize() {
    if (!this.canvas.clientWidth) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map(v => Math.max(1, Math.round(v * ratio)));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
  }

  draw(camera, scene, paper) {
    const { gl } = this;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...paper, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const view = camera.matrix();
    this.lines(view, scene.lines);
    const solid = scene.bodies.filter(b => b.alpha === 1 && !b.front), clear = scene.bodies.filter(b => b.alpha < 1);
    clear.sort((a, b) => camera.depth(b.at.slice(12, 15)) - camera.depth(a.at.slice(12, 15)));
    this.room(...["positions", "triangles"].map(part => scene.bodies.reduce((sum, b) => sum + b.mesh[part].length, 0)));
    this.used = { corners: 0, indices: 0 };
    const lamps = this.lamps(camera);
    for (const body of solid) this.add(body, lamps);
    const first = this.used.indices;
    for (const body of clear) this.add(body, lamps);
    const second = this.used.indices;
    for (const body of scene.bodies) if (body.front) this.add(body, lamps);
    gl.useProgram(this.body.program);
    gl.uniformMatrix4fv(this.body.places.view, false, view);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ARRAY_BUFFER, this.places.subarray(0, this.used.corners * CORNER), gl.DYNAMIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.triangles);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.indices.subarray(0, this.used.indices), gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 4 * CORNER, 0);
    gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 4 * CORNER, 12);
    gl.drawElements(gl.TRIANGLES, first, gl.UNSIGNED_INT, 0);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    gl.drawElements(gl.TRIANGLES, second - first, gl.UNSIGNED_INT, 4 * first);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    // what says something is seen through what is not
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.drawElements(gl.TRIANGLES, this.used.indices - second, gl.UNSIGNED_INT, 4 * second);
    gl.disableVertexAttribArray(1);
  }

  /** A key light from above, a fill from below. */
  lamps(camera) {
    const { back, right, up } = camera.axes();
    return [unit(add(add(back, times(up, 0.9)), times(right, -0.5))), unit(add(times(up, -0.6), right))];
  }

  add({ mesh, at, colour, alpha }, [key, fill]) {
    const { used, places, colours, indices } = this;
    const { positions, normals, triangles } = mesh;
    const [x, y, z, o] = [0, 4, 8, 12].map(n => at.slice(n, n + 3));
    // normals turn by the cofactors, which are right whatever the stretch
    const [a, b, c] = [cross(y, z), cross(z, x), cross(x, y)];
    for (let n = 0; n < positions.length; n += 3) {
      const [px, py, pz] = [positions[n], positions[n + 1], positions[n + 2]];
      const [nx, ny, nz] = [normals[n], normals[n + 1], normals[n + 2]];
      const to = (used.corners + n / 3) * CORNER;
      const normal = [a[0] * nx + b[0] * ny + c[0] * nz, a[1] * nx + b[1] * ny + c[1] * nz, a[2] * nx + b[2] * ny + c[2] * nz];
      const length = norm(normal) || 1;
      const light = 0.5 + 0.46 * Math.max(dot(normal, key) / length, 0) + 0.16 * Math.max(dot(normal, fill) / length, 0);
      for (let i = 0; i < 3; i++) {
        places[to + i] = x[i] * px + y[i] * py + z[i] * pz + o[i];
        colours[4 * to + 12 + i] = Math.min(255 * light * colour[i], 255);
      }
      colours[4 * to + 15] = 255 * alpha;
    }
    for (let n = 0; n < triangles.length; n++) indices[used.indices + n] = used.corners + triangles[n];
    used.corners += positions.length / 3;
    used.indices += triangles.length;
  }

  lines(view, lines) {
    const { gl, line } = this;
    gl.useProgram(line.program);
    gl.uniformMatrix4fv(line.places.view, false, view);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    for (const { points, colour } of lines) {
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points.flat()), gl.DYNAMIC_DRAW);
      gl.uniform4f(line.places.colour, ...colour, 1);
      for (const [x, y] of [[0, 0], [1, 0], [0, 1], [1, 1]]) {
        gl.uniform2f(line.places.aside, 2 * x / this.canvas.width, 2 * y / this.canvas.height);
        gl.drawArrays(gl.LINE_STRIP, 0, points.length);
      }
    }
  }
}
