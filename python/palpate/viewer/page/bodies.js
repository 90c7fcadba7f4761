// The surfaces of the bodies: sharp at creases, smooth elsewhere, moved in place each frame.

import { BufferAttribute, BufferGeometry, Color, DoubleSide, DynamicDrawUsage, Mesh, MeshLambertMaterial, MeshPhysicalMaterial, SRGBColorSpace } from "three";
import { rampIndex } from "palpate/colors";

/** Cosine of the angle between neighbours from which an edge is drawn sharp. */
const CREASE = 0.6;
/** What is seen inside of a body. */
const FLESH = new Color().setRGB(0.96, 0.8, 0.74, SRGBColorSpace);

export class BodyMesh extends Mesh {
  /** `plain`: light that costs little; `cut`: 1 for triangles that a blade made, or undefined; `start` is the row of the body's first node in a frame's positions, `firstTriangle` likewise. */
  constructor(look, plain, rest, triangles, cut, start, firstTriangle) {
    const { origin, index } = split(rest, triangles, cut);
    const geometry = new BufferGeometry();
    for (const name of ["position", "normal"]) {
      const attribute = new BufferAttribute(new Float32Array(3 * origin.length), 3);
      geometry.setAttribute(name, attribute.setUsage(DynamicDrawUsage));
    }
    geometry.setIndex(new BufferAttribute(index, 1));
    super(geometry, materialOf(look, plain));
    Object.assign(this, { look, rest, triangles, origin, start, firstTriangle });
    this.nodeCount = rest.length / 3;
    this.frustumCulled = false;
    this.castShadow = look.opacity > 0.6;
    this.receiveShadow = true;
    // Which vertices belong to the surface of a cut.
    this.inside = cut?.some(Boolean) ? new Uint8Array(origin.length) : null;
    if (this.inside) index.forEach((vertex, corner) => (this.inside[vertex] = cut[Math.floor(corner / 3)]));
    this.renderOrder = look.opacity < 1 ? 1 : 0;
    this.move(rest, 0);
    this.paint(null);
  }

  /** Put the nodes where rows `start` and on of `positions` say. */
  move(positions, start = this.start) {
    const { position, normal } = this.geometry.attributes;
    const to = position.array;
    const { origin } = this;
    for (let i = 0, j = 0; i < origin.length; i++, j += 3) {
      const from = 3 * (start + origin[i]);
      to[j] = positions[from];
      to[j + 1] = positions[from + 1];
      to[j + 2] = positions[from + 2];
    }
    smoothNormals(to, this.geometry.index.array, normal.array);
    position.needsUpdate = true;
    normal.needsUpdate = true;
    this.geometry.boundingSphere = null;
  }

  /** Colour by values of the frame's nodes, from 0 to `high`; null: the body's own colour, flesh where it was cut. */
  paint(values, high, colors) {
    const painted = values !== null || this.inside !== null;
    if (values !== null) {
      const { array } = this.vertexColors();
      for (let i = 0, j = 0; i < this.origin.length; i++, j += 3) {
        const at = rampIndex(values[this.start + this.origin[i]] / high);
        array[j] = colors[at];
        array[j + 1] = colors[at + 1];
        array[j + 2] = colors[at + 2];
      }
    } else if (this.inside) {
      const { array } = this.vertexColors();
      const [outer, inner] = [this.tint, this.tint.lerp(FLESH, 0.6)].map((color) => color.toArray());
      this.inside.forEach((inside, i) => array.set(inside ? inner : outer, 3 * i));
    }
    if (this.material.vertexColors !== painted) {
      this.material.vertexColors = painted;
      this.material.needsUpdate = true;
    }
    this.material.color.copy(painted ? new Color(1, 1, 1) : this.tint);
    this.colored = values !== null;
  }

  /** The colours of the vertices, to be written. */
  vertexColors() {
    let attribute = this.geometry.attributes.color;
    if (!attribute) {
      attribute = new BufferAttribute(new Float32Array(3 * this.origin.length), 3);
      this.geometry.setAttribute("color", attribute.setUsage(DynamicDrawUsage));
    }
    attribute.needsUpdate = true;
    return attribute;
  }

  get tint() {
    return new Color().setRGB(...this.look.color, SRGBColorSpace);
  }

  /** Show with another colour, opacity, as wires. */
  restyle({ color, opacity, wireframe }) {
    if (color !== undefined) this.look.color = color;
    const { material } = this;
    if (!this.colored) this.paint(null);
    if (opacity !== undefined) {
      this.look.opacity = opacity;
      material.opacity = opacity;
      material.transparent = opacity < 1;
      material.depthWrite = opacity > 0.6;
      this.castShadow = opacity > 0.6;
      this.renderOrder = opacity < 1 ? 1 : 0;
    }
    if (wireframe !== undefined) material.wireframe = wireframe;
    material.needsUpdate = true;
  }

  /** The frame's row nearest to a point [m] among the corners of a hit triangle, and its place. */
  nearestNode(face, point) {
    const { array } = this.geometry.attributes.position;
    let best = Infinity;
    let corner = face.a;
    for (const each of [face.a, face.b, face.c]) {
      const distance = Math.hypot(...[0, 1, 2].map((axis) => array[3 * each + axis] - point.getComponent(axis)));
      if (distance < best) [best, corner] = [distance, each];
    }
    return { node: this.origin[corner], at: array.slice(3 * corner, 3 * corner + 3) };
  }

  dispose() {
    this.geometry.dispose();
    this.material.dispose();
  }
}

function materialOf(look, plain) {
  const common = { side: DoubleSide, opacity: look.opacity, transparent: look.opacity < 1, depthWrite: look.opacity > 0.6 };
  const wet = { roughness: look.rigid ? 0.55 : 0.48, metalness: 0, clearcoat: look.rigid ? 0 : 0.35, clearcoatRoughness: 0.42 };
  const material = plain ? new MeshLambertMaterial(common) : new MeshPhysicalMaterial({ ...common, ...wet });
  material.color.setRGB(...look.color, SRGBColorSpace);
  return material;
}

function smoothNormals(positions, index, normals) {
  normals.fill(0);
  for (let t = 0; t < index.length; t += 3) {
    const a = 3 * index[t], b = 3 * index[t + 1], c = 3 * index[t + 2];
    const ux = positions[b] - positions[a], uy = positions[b + 1] - positions[a + 1], uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a], vy = positions[c + 1] - positions[a + 1], vz = positions[c + 2] - positions[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    normals[a] += x; normals[a + 1] += y; normals[a + 2] += z;
    normals[b] += x; normals[b + 1] += y; normals[b + 2] += z;
    normals[c] += x; normals[c + 1] += y; normals[c + 2] += z;
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    normals[i] /= length; normals[i + 1] /= length; normals[i + 2] /= length;
  }
}

/**
 * One vertex per node and smooth group of triangles around it. Triangles at a node are of one group
 * when a chain of them leads from one to the other without a crease, or the rim of a cut.
 */
export function split(rest, triangles, cut) {
  const count = triangles.length / 3;
  const normals = new Float32Array(triangles.length);
  for (let t = 0; t < count; t++) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * triangles[3 * t + k]);
    const u = [0, 1, 2].map((k) => rest[b + k] - rest[a + k]);
    const v = [0, 1, 2].map((k) => rest[c + k] - rest[a + k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...n) || 1;
    for (let k = 0; k < 3; k++) normals[3 * t + k] = n[k] / length;
  }
  const around = Array.from({ length: rest.length / 3 }, () => []);
  for (let corner = 0; corner < triangles.length; corner++) around[triangles[corner]].push(corner);
  const origin = [];
  const index = new Uint32Array(triangles.length);
  const alike = (p, q) => {
    const s = 3 * Math.floor(p / 3), t = 3 * Math.floor(q / 3);
    if (cut && cut[s / 3] !== cut[t / 3]) return false;
    return normals[s] * normals[t] + normals[s + 1] * normals[t + 1] + normals[s + 2] * normals[t + 2] > CREASE;
  };
  for (let node = 0; node < around.length; node++) {
    let left = around[node];
    while (left.length > 0) {
      const vertex = origin.push(node) - 1;
      const group = [left[0]];
      left = left.slice(1);
      for (let i = 0; i < group.length; i++) {
        index[group[i]] = vertex;
        const next = left.filter((corner) => alike(group[i], corner));
        group.push(...next);
        left = left.filter((corner) => !next.includes(corner));
      }
    }
  }
  return { origin: Uint32Array.from(origin), index };
}
