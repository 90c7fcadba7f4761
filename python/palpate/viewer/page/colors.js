// Colours for values: viridis, as a polynomial, and its legend.

const RED = [0.2777, 0.1051, -0.3309, -4.6342, 6.2283, 4.7764, -5.4355];
const GREEN = [0.0054, 1.4046, 0.2148, -5.7991, 14.1799, -13.7451, 4.6459];
const BLUE = [0.3341, 1.3846, 0.0951, -19.3324, 56.6906, -65.353, 26.3124];
const STEPS = 256;

function polynomial(factors, x) {
  return factors.reduceRight((sum, factor) => sum * x + factor, 0);
}

/** 256 rows of red, green, blue in 0..1, linear light for the renderer. */
export const RAMP = new Float32Array(3 * STEPS);
const CSS = [];
for (let i = 0; i < STEPS; i++) {
  const x = i / (STEPS - 1);
  const rgb = [RED, GREEN, BLUE].map((each) => Math.min(1, Math.max(0, polynomial(each, x))));
  rgb.forEach((value, channel) => {
    RAMP[3 * i + channel] = value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  });
  if (i % 15 === 0) CSS.push(`rgb(${rgb.map((value) => Math.round(255 * value)).join(" ")})`);
}

/** The ramp for the legend. */
export const GRADIENT = `linear-gradient(90deg, ${CSS.join(", ")})`;

/** Offset into RAMP of a value in 0..1. */
export function rampIndex(value) {
  return 3 * Math.round(Math.min(1, Math.max(0, value)) * (STEPS - 1));
}

/** `least`: the smallest end of the legend, so that noise is not painted; of lengths, by the scene's. */
export const FIELDS = {
  displacement: { name: "Displacement", unit: "m", least: 1e-4 },
  deformation: { name: "Deformation", unit: "m", least: 1e-4, note: "off the best rigid motion" },
  strain: { name: "Strain", unit: "", least: 1e-3, note: "equivalent strain, the mean around each node" },
  stress: { name: "Stress", unit: "Pa", least: 1, note: "von Mises, the mean around each node; laws other than linear" },
  depth: { name: "Penetration depth", unit: "m", least: 1e-5 },
  force: { name: "Contact force", unit: "N", least: 1e-6 },
};
