// Milliseconds per stage of the last steps, stacked.

const COLORS = ["#0f6b78", "#e08a5b", "#7f9cc7", "#c9b458", "#9a6fa5", "#6fae8f", "#c56a76", "#8d99a3", "#b08f6a", "#5f7fb0"];
const KEPT = 240;

export class Chart {
  constructor(canvas, list) {
    this.canvas = canvas;
    this.list = list;
    this.rows = [];
    this.stages = [];
  }

  /** `times` maps stages to seconds of the last step; `limit` [s] is what real time allows. */
  add(times, limit) {
    const total = times.total ?? Object.values(times).reduce((sum, each) => sum + each, 0);
    for (const stage of Object.keys(times)) {
      if (stage !== "total" && !this.stages.includes(stage)) this.stages.push(stage);
    }
    const known = this.stages.reduce((sum, stage) => sum + (times[stage] ?? 0), 0);
    this.rows.push({ parts: this.stages.map((stage) => times[stage] ?? 0), rest: Math.max(0, total - known), total });
    if (this.rows.length > KEPT) this.rows.shift();
    this.limit = limit;
  }

  draw() {
    const { canvas } = this;
    const width = (canvas.width = canvas.clientWidth * devicePixelRatio);
    const height = (canvas.height = canvas.clientHeight * devicePixelRatio);
    if (width === 0 || this.rows.length === 0) return;
    const pen = canvas.getContext("2d");
    const sorted = this.rows.map((row) => row.total).sort((a, b) => a - b);
    const usual = sorted[Math.floor(0.97 * (sorted.length - 1))];
    const high = 1.15 * Math.max(usual, this.limit * 1.05, 1e-6);
    const step = width / KEPT;
    const left = width - step * this.rows.length;
    this.rows.forEach((row, i) => {
      let y = height;
      [...row.parts, row.rest].forEach((seconds, stage) => {
        const size = (seconds / high) * height;
        pen.fillStyle = stage < this.stages.length ? COLORS[stage % COLORS.length] : "#cfd7dc";
        pen.fillRect(left + i * step, y - size, step + 0.5, size);
        y -= size;
      });
    });
    const y = height - (this.limit / high) * height;
    pen.strokeStyle = "#a3271b";
    pen.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
    pen.lineWidth = devicePixelRatio;
    pen.beginPath();
    pen.moveTo(0, y);
    pen.lineTo(width, y);
    pen.stroke();
    pen.fillStyle = "#a3271b";
    pen.font = `${10 * devicePixelRatio}px system-ui, sans-serif`;
    pen.fillText(`real time ${(1e3 * this.limit).toFixed(1)} ms`, 5 * devicePixelRatio, y - 3 * devicePixelRatio);
    this.name();
  }

  name() {
    const recent = this.rows.slice(-30);
    const mean = (pick) => recent.reduce((sum, row) => sum + (pick(row) ?? 0), 0) / recent.length;
    const entries = this.stages.map((stage, i) => [stage, COLORS[i % COLORS.length], mean((row) => row.parts[i])]);
    entries.push(["rest", "#cfd7dc", mean((row) => row.rest)]);
    this.list.replaceChildren(
      ...entries.map(([stage, color, seconds]) => {
        const row = document.createElement("span");
        const swatch = Object.assign(document.createElement("i"), { style: `background:${color}` });
        const value = Object.assign(document.createElement("b"), { textContent: `${(1e3 * seconds).toFixed(2)}` });
        row.append(swatch, stage.replaceAll("_", " "), value);
        return row;
      }),
    );
  }
}
