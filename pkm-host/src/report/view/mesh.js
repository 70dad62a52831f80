// Meshes of unit size: positions, normals, triangles.

const Mesh = (() => {
  // enough to look round, few enough for a processor that draws without help
  const ROUND = 20;

  /** Corners as [position, normal], faces as rows of corners. */
  function mesh(faces) {
    const positions = [], normals = [], triangles = [];
    for (const face of faces) {
      const first = positions.length / 3;
      for (const [position, normal] of face) {
        positions.push(...position);
        normals.push(...normal);
      }
      for (let i = 2; i < face.length; i++) triangles.push(first, first + i - 1, first + i);
    }
    return { positions: new Float32Array(positions), normals: new Float32Array(normals), triangles: new Uint16Array(triangles) };
  }

  const circle = (n, count = ROUND) => [Math.cos(2 * Math.PI * n / count), Math.sin(2 * Math.PI * n / count)];
  const ring = Array.from({ length: ROUND }, (_, n) => n);

  /** Radius 1, along z from 0 to 1; `top` is the radius there. */
  function cylinder(top) {
    const at = (n, z) => {
      const [c, s] = circle(n);
      const r = z ? top : 1;
      return [[c * r, s * r, z], unit([c, s, 1 - top])];
    };
    const sides = ring.map(n => [at(n, 0), at(n + 1, 0), at(n + 1, 1), at(n, 1)]);
    const cap = (z, r) => ring.map(n => { const [c, s] = circle(z ? n : -n); return [[c * r, s * r, z], [0, 0, 2 * z - 1]]; });
    return mesh([...sides, cap(0, 1), ...(top ? [cap(1, top)] : [])]);
  }

  function sphere(count, rows) {
    const at = (i, j) => {
      const [c, s] = circle(i, count), t = Math.PI * j / rows;
      const p = [c * Math.sin(t), s * Math.sin(t), -Math.cos(t)];
      return [p, p];
    };
    const faces = [];
    for (let i = 0; i < count; i++) for (let j = 0; j < rows; j++) faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
    return mesh(faces);
  }

  /** A polygon in the plane z = 0 of [x, y], counter-clockwise, extruded to both sides. */
  function prism(outline, thickness) {
    const h = thickness / 2;
    const faces = outline.map((a, n) => {
      const b = outline[(n + 1) % outline.length];
      const normal = unit([b[1] - a[1], a[0] - b[0], 0]);
      return [[...a, -h], [...b, -h], [...b, h], [...a, h]].map(p => [p, normal]);
    });
    faces.push(outline.map(p => [[...p, h], [0, 0, 1]]));
    faces.push([...outline].reverse().map(p => [[...p, -h], [0, 0, -1]]));
    return mesh(faces);
  }

  /** A plate that leaves a rim about each of its bores. */
  function plate(bores, radius, thickness) {
    const points = bores.flatMap(([x, y]) => ring.map(n => { const [c, s] = circle(n); return [x + radius * c, y + radius * s]; }));
    return prism(hull(points), thickness);
  }

  return { plate, cylinder: cylinder(1), cone: cylinder(0), taper: cylinder(0.45), ball: sphere(12, 6), sphere: sphere(28, 14) };
})();
