// The bar at the bottom: play, pause, step, reset, undo, speed, and the slider of a recording.

import { icon, make } from "palpate/text";

const PLAY = "M8 5.5v13l11-6.5z";
const PAUSE = "M7 5h3.600v14H7zM13.4 5H17v14h-3.600z";
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5];

export class Transport {
  constructor(element, app) {
    this.app = app;
    const button = (name, title, path, action) => {
      const made = make("button", { title, "aria-label": title, onclick: action, "data-action": name });
      made.append(icon(path));
      return made;
    };
    this.play = button("play", "Play or pause (space)", PLAY, () => app.togglePlay());
    this.play.classList.add("play");
    this.step = button("step", "One step (→)", "M6 5.5 15 12l-9 6.500zM18 6v12", () => app.step());
    this.reset = button("reset", "Back to the start (R)", "M5 12a7 7 0 1 0 2.2-5.100M4.5 4.500v4h4", () => app.reset());
    this.undo = button("undo", "Undo the cut (Z)", "M9 14 4.5 9.5 9 5M5 9.500h9a5 5 0 0 1 0 10h-3", () => app.send({ type: "undo" }));
    this.frame = button("frame", "Frame the scene (F)", "M4 9V5h4M16 5h4v4M20 15v4h-4M8 19H4v-4", () => app.stage.frameCamera());
    this.picture = button("picture", "Save a picture (S)", "M4 8h3l2-2.5h6L17 8h3v11H4zM12 10a3.3 3.3 0 1 0 0 6.6 3.3 3.3 0 0 0 0-6.6", () => app.savePicture());
    this.help = button("help", "Help (?)", "M9.2 9.3a2.9 2.9 0 1 1 4.2 2.6c-.9.5-1.4 1.1-1.4 2.1M12 17.4v.1M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18", () => app.help());
    this.time = make("span", { class: "time", title: "Simulated time" }, "0.00 s");
    this.speed = make(
      "select",
      { title: "Speed", "aria-label": "Speed", onchange: () => this.choose() },
      ...SPEEDS.map((value) => make("option", { value }, `${value}×`)),
      make("option", { value: "max" }, "fastest"),
    );
    this.slider = make("input", { type: "range", min: 0, value: 0, step: 1, "aria-label": "Moment of the recording", hidden: true });
    this.slider.oninput = () => app.send({ type: "seek", frame: Number(this.slider.value) });
    const bar = () => make("span", { class: "bar" });
    element.append(this.reset, this.play, this.step, bar(), this.time, this.slider, this.speed, bar(), this.undo, this.frame, this.picture, this.help);
  }

  choose() {
    this.app.send({ type: "speed", value: this.speed.value === "max" ? null : Number(this.speed.value) });
    this.speed.blur();
  }

  hello(header) {
    const recording = header.mode === "recording";
    this.slider.hidden = !recording;
    if (recording) this.slider.max = header.times.length - 1;
    this.undo.hidden = !header.features.includes("cut");
    this.speed.lastChild.hidden = recording;
  }

  state(state) {
    this.play.replaceChildren(icon(state.playing ? PAUSE : PLAY));
    this.play.setAttribute("aria-pressed", state.playing);
    this.undo.disabled = !state.undo;
    const value = state.speed === null ? "max" : String(state.speed);
    if (![...this.speed.options].some((option) => option.value === value)) {
      this.speed.append(make("option", { value }, `${state.speed}×`));
    }
    this.speed.value = value;
  }

  moment(header) {
    this.time.textContent = `${header.time.toFixed(2)} s`;
    if (header.frame !== undefined && document.activeElement !== this.slider) this.slider.value = header.frame;
    else if (header.frame !== undefined && this.app.state?.playing) this.slider.value = header.frame;
  }
}
