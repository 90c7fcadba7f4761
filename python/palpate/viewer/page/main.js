// Puts the page together: messages come in, the stage and the panel follow, commands go out.

import { FIELDS, endOfScale } from "palpate/colors";
import { Connection } from "palpate/connection";
import { Transport } from "palpate/controls";
import { Overlay } from "palpate/overlay";
import { Panel, showLegend } from "palpate/panel";
import { Pointer } from "palpate/pointer";
import { DEEPEST, PROTOCOL, positionsOf, valuesOf } from "palpate/protocol";
import { Recording } from "palpate/recording";
import { Stage } from "palpate/stage";

/** Name of the body that pushes, see `probe.py`. */
const PROBE = "viewer probe";

const find = (name) => document.getElementById(name);

class App {
  constructor() {
    this.view = {
      field: null, range: 1, contacts: false, touching: false, wireframe: false, boxes: false, level: 0, grid: true, opacity: 1, strength: 1, grip: 1, probe: 1, cutDepth: null,
    };
    this.mode = "look";
    this.features = [];
    this.high = 0;
    this.received = 0;
    this.stage = new Stage(find("stage"));
    this.overlay = new Overlay(this.stage, find("labels"));
    this.transport = new Transport(find("transport"), this);
    this.panel = new Panel(find("panel"), this);
    this.pointer = new Pointer(this.stage, this);
    for (const button of find("modes").children) button.onclick = () => this.setMode(button.dataset.mode);
    find("panel_toggle").onclick = () => this.togglePanel();
    const [again, look] = find("problem").querySelectorAll("button");
    again.onclick = () => this.send({ type: "reload" });
    look.onclick = () => (find("problem").hidden = true);
    addEventListener("keydown", (event) => this.key(event));
    this.togglePanel(innerWidth >= 900);
    this.setMode("look");
    const recording = find("recording");
    const Source = recording ? Recording : Connection;
    this.source = new Source((message) => this.receive(message), (open) => this.connected(open), recording);
  }

  send(command) {
    this.source.send(command);
  }

  can(feature) {
    return this.features.includes(feature);
  }

  receive(message) {
    const { header } = message;
    if (header.type === "frame") return this.frame(message);
    if (header.type === "hello") this.hello(header);
    else if (header.type === "scene") this.scene(message);
    else if (header.type === "state") this.setState(header);
    else if (header.type === "notice") this.toast(header.text);
    else if (header.type === "problem") this.problem(header);
  }

  hello(header) {
    if (header.protocol !== PROTOCOL) return location.reload();
    this.features = header.features;
    this.modeOfSource = header.mode;
    this.loading(header.mode === "loading" ? "Loading the model" : null);
    find("title").textContent = header.title;
    document.title = header.title ? `${header.title} – palpate` : "palpate";
    this.haveScene = false;
    if (header.mode === "loading") return;
    find("problem").hidden = true;
    this.transport.hello(header);
    this.panel.hello(header);
    const needs = { look: null, pull: "pull", push: "tool", cut: "cut" };
    for (const button of find("modes").children) {
      const need = needs[button.dataset.mode];
      button.hidden = need !== null && !this.can(need);
    }
    find("modes").hidden = !this.can("pull") && !this.can("cut");
    if (!this.chosen) this.setMode(this.can("pull") ? "pull" : "look");
    if (!(header.fields ?? []).includes(this.view.field)) this.view.field = null;
    this.subscribe();
  }

  scene(message) {
    const { header } = message;
    this.version = header.version;
    find("problem").hidden = true;
    const names = header.bodies.map((body) => body.name).join("/");
    // Pieces of a cut come and go at the end; anything else is another scene.
    const same = this.haveScene && (names.startsWith(this.names) || this.names.startsWith(names));
    this.stage.setScene(message, same);
    this.names = names;
    this.unframed ||= !this.haveScene;
    this.haveScene = true;
    this.high = 0;
    this.panel.scene();
    this.restyle();
  }

  frame(message) {
    const { header, arrays } = message;
    if (header.version !== this.version) return;
    this.received += 1;
    const positions = positionsOf(message);
    this.positions = positions;
    this.last = message;
    this.stage.move(positions);
    // At the start, and back at the start, as long as the user has left the camera alone.
    if (this.unframed || (header.time < this.time && !this.stage.cameraMoved)) this.stage.frameCamera();
    this.unframed = false;
    this.time = header.time;
    this.overlay.update(message, positions, this.view);
    if (this.view.boxes && this.can("levels")) this.panel.tellLevel(this.overlay.boxCount);
    this.paint(header, positions);
    this.transport.moment(header);
    this.chips(header);
    const probe = this.stage.bodies.find((body) => body.look.name === PROBE);
    if (probe) probe.visible = Boolean(header.tool);
    if (header.numbers) {
      if (header.numbers.times) this.panel.chart.add(header.numbers.times, this.state?.time_step ?? 0);
      this.figures(header.numbers);
    }
    this.loading(null);
  }

  /** Figures are for eyes: four times a second. */
  figures(numbers) {
    this.newest = numbers;
    this.figuresDue ??= setTimeout(() => {
      this.figuresDue = undefined;
      this.panel.numbers(this.newest);
    }, 250);
  }

  paint(header, positions) {
    const { field } = this.view;
    const values = field === "displacement" && header.quantised ? this.displacements(positions) : valuesOf(this.last, field);
    if (!field || !values) {
      for (const body of this.stage.bodies) body.paint(null);
      showLegend(find("legend"), null);
      return;
    }
    const soft = this.stage.bodies.filter((body) => !body.look.rigid);
    const most = Math.max(...soft.map((body) => endOfScale(values.subarray(body.start, body.start + body.nodeCount))));
    const { least, unit, ramp } = FIELDS[field];
    // The range grows at once and shrinks slowly, so that colours do not flicker.
    this.high = Math.max(most, 0.985 * this.high, least * (unit === "m" ? this.stage.size : 1));
    const high = this.view.range * this.high;
    for (const body of this.stage.bodies) body.paint(body.look.rigid ? null : values, high, ramp.colors);
    showLegend(find("legend"), field, high);
  }

  displacements(positions) {
    const values = new Float32Array(positions.length / 3);
    for (const body of this.stage.bodies) {
      for (let i = 0; i < body.nodeCount; i++) {
        const [from, to] = [3 * i, 3 * (body.start + i)];
        values[body.start + i] = Math.hypot(...[0, 1, 2].map((k) => positions[to + k] - body.rest[from + k]));
      }
    }
    return values;
  }

  setState(state) {
    this.state = state;
    this.transport.state(state);
    this.panel.state(state);
    document.body.dataset.playing = state.playing;
    if (!state.playing) this.chips(this.last?.header);
  }

  chips(header) {
    const chips = [];
    const { state } = this;
    const rate = header?.numbers?.real_time;
    if (this.broken) chips.push(["bad", "no connection, trying again"]);
    else if (this.modeOfSource === "live" && state?.playing && rate) {
      const wanted = state.speed;
      const behind = wanted !== null && rate < 0.92 * wanted;
      const text = `${rate.toFixed(2)}× real time`;
      chips.push(behind ? ["warn", `${text}, behind`, "The simulation cannot keep up with the chosen speed"] : ["", text]);
    } else if (this.modeOfSource === "recording") chips.push(["", "recording"]);
    const key = JSON.stringify(chips.map((chip) => chip.slice(0, 2)));
    if (key === this.chipKey) return;
    this.chipKey = key;
    find("chips").replaceChildren(
      ...chips.map(([kind, text, title]) => Object.assign(document.createElement("span"), { className: `chip ${kind}`, textContent: text, title: title ?? "" })),
    );
  }

  connected(open) {
    this.broken = !open;
    this.chips(this.last?.header);
    if (open) this.loading(null);
  }

  loading(text) {
    find("veil").classList.toggle("gone", !text);
    if (text) find("veil").lastElementChild.textContent = text;
  }

  problem({ title, text }) {
    this.loading(null);
    find("problem").hidden = false;
    find("problem").querySelector('[data-action="look"]').hidden = !this.haveScene;
    find("problem").querySelector("h2").textContent = title;
    find("problem").querySelector("pre").textContent = text;
  }

  toast(text) {
    const toast = Object.assign(document.createElement("div"), { className: "toast", textContent: text });
    find("toasts").append(toast);
    while (find("toasts").children.length > 3) find("toasts").firstChild.remove();
    setTimeout(() => toast.remove(), 4500);
  }

  /** Change what is shown: any of the entries of `view`. */
  set(change) {
    Object.assign(this.view, change);
    if ("field" in change) {
      this.high = 0;
      this.view.range = 1;
    }
    this.panel.reflect(this.view);
    this.restyle(change);
    this.subscribe();
    if (this.last) {
      this.overlay.update(this.last, this.positions, this.view);
      this.paint(this.last.header, this.positions);
    }
    this.stage.touch();
  }

  restyle(change = this.view) {
    for (const body of this.stage.bodies) {
      if (change.wireframe !== undefined) body.restyle({ wireframe: change.wireframe });
      if (change.opacity !== undefined && !body.look.rigid && (change.opacity < 1 || change !== this.view)) body.restyle({ opacity: change.opacity });
    }
    this.stage.ground.grid.visible = this.stage.ground.shadow.visible = this.view.grid;
  }

  subscribe() {
    const { field, contacts, touching, boxes, level } = this.view;
    // The boxes of whole bodies are made of the positions, here.
    this.send({ type: "show", field, contacts, touching, level: boxes && level > 0 && this.can("levels") ? level : null });
  }

  /** Show the boxes of a deeper or higher level of the bounding trees. */
  moveLevel(by) {
    if (!this.can("levels")) return;
    this.set({ boxes: true, level: Math.min(DEEPEST, Math.max(0, this.view.level + by)) });
  }

  setMode(mode) {
    this.mode = mode;
    find("stage").dataset.mode = mode;
    for (const button of find("modes").children) button.setAttribute("aria-pressed", button.dataset.mode === mode);
  }

  togglePlay() {
    this.send({ type: "play", on: !this.state?.playing });
  }

  step() {
    this.send({ type: "step", count: 1 });
  }

  reset() {
    this.send({ type: "reset" });
  }

  async savePicture() {
    const picture = URL.createObjectURL(await this.stage.picture());
    const name = `${find("title").textContent || "palpate"} ${this.time?.toFixed(2) ?? 0} s.png`;
    Object.assign(document.createElement("a"), { href: picture, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(picture), 10_000);
  }

  help() {
    find("help").showModal();
  }

  togglePanel(shown = document.body.classList.contains("bare")) {
    document.body.classList.toggle("bare", !shown);
    this.stage.cover(shown ? find("panel").offsetWidth : 0);
  }

  key(event) {
    if (find("help").open) return;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest?.("input:not([type=checkbox]):not([type=range]), select")) return;
    const toggles = { c: "contacts", t: "touching", w: "wireframe", b: "boxes", g: "grid" };
    const key = event.key.toLowerCase();
    const modes = { 1: "look", 2: "pull", 3: "push", 4: "cut" };
    const actions = {
      " ": () => this.togglePlay(), arrowright: () => this.step(), r: () => this.reset(), f: () => this.stage.frameCamera(),
      z: () => this.can("cut") && this.send({ type: "undo" }), p: () => this.togglePanel(), escape: () => this.pointer.cancel(), "?": () => this.help(), s: () => this.savePicture(),
      "[": () => this.moveLevel(-1), "]": () => this.moveLevel(1),
    };
    if (toggles[key]) this.set({ [toggles[key]]: !this.view[toggles[key]] });
    else if (modes[key]) {
      this.chosen = true;
      const button = [...find("modes").children].find((each) => each.dataset.mode === modes[key]);
      if (!button.hidden) this.setMode(modes[key]);
    } else if (actions[key]) actions[key]();
    else return;
    event.preventDefault();
  }
}

globalThis.palpate = new App();
