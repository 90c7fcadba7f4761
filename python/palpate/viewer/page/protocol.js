// Messages of the server, as `protocol.py` describes them.

export const PROTOCOL = 1;

/** Deepest level of the bounding trees that may be asked for. */
export const DEEPEST = 16;

const TYPES = { float32: Float32Array, uint32: Uint32Array, uint16: Uint16Array, uint8: Uint8Array };
const text = new TextDecoder();

/** Header and arrays of a message: {header, arrays: {name: typed array}}. Arrays are views. */
export function decode(buffer, offset = 0, length = buffer.byteLength - offset) {
  const view = new DataView(buffer, offset, length);
  const size = view.getUint32(0, true);
  const header = JSON.parse(text.decode(new Uint8Array(buffer, offset + 4, size)));
  const arrays = {};
  let at = offset + 4 + size;
  for (const [name, type, shape] of header.arrays) {
    const count = shape.reduce((product, each) => product * each, 1);
    const array = new TYPES[type](buffer, at, count);
    arrays[name] = array;
    at += array.byteLength + ((4 - (array.byteLength % 4)) % 4);
  }
  return { header, arrays };
}

/** Positions of a frame as float32 [m]: those of an exported film are whole steps from a corner. */
export function positionsOf({ header, arrays }) {
  if (!header.quantised) return arrays.positions;
  const { low, step } = header.quantised;
  const whole = arrays.positions;
  const result = new Float32Array(whole.length);
  for (let i = 0; i < whole.length; i++) result[i] = low[i % 3] + whole[i] * step[i % 3];
  return result;
}

/** Values of a frame's nodes that a colour stands for, or null: those of an exported film are shades of the largest. */
export function valuesOf({ header, arrays }, field) {
  const values = arrays[`field/${field}`] ?? null;
  const high = header.quantised?.high[field];
  return values && high !== undefined ? Float32Array.from(values, (shade) => (shade / 255) * high) : values;
}
