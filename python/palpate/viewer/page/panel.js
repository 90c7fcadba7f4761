// The panel at the right: figures, what is shown, bodies with their settings, the simulation.

import { Chart } from "palpate/chart";
import { FIELDS } from "palpate/colors";
import { DEEPEST } from "palpate/protocol";
import { digits, icon, make, whole, withUnit } from "palpate/text";

const EYE = "M2.5 12S6 5.5 12 5.5 21.5 12 21.5 12 18 18.5 12 18.5 2.5 12 2.5 12zM12 9a3 3 0 1 1 0 6 3 3 0 0 1 0-6";
const CLOSE = "M6 6l12 12M18 6 6 18";
const MATERIAL = [
  ["young", "Stiffness", "Pa", "Young's modulus"],
  ["poisson", "Poisson's ratio", "", "from 0 to just below 0.5"],
  ["density", "Density", "kg/m³", ""],
  ["damping", "Damping", "s", "Rayleigh damping with the stiffness"],
];
const CONTACT = [
  ["friction", "Friction", "", "Coulomb's coefficient"],
  ["distance", "Distance", "m", "below which surfaces push each other apart; empty: from the mesh"],
  ["stiffness", "Penalty", "Pa/m", "empty: from material and mesh"],
];

export class Panel {
  constructor(element, app) {
    this.app = app;
    this.element = element;
    this.open = new Set();
    const close = make("button", { class: "close", title: "Hide (P)", "aria-label": "Hide the settings", onclick: () => app.togglePanel() });
    close.append(icon(CLOSE));
    this.show = section("Show", true);
    this.bodies = section("Bodies", true);
    this.simulation = section("Simulation", false);
    this.hands = section("Hands", false);
    this.performance = section("Performance", true);
    element.append(close, ...[this.performance, this.show, this.bodies, this.hands, this.simulation].map((each) => each.element));
    this.buildPerformance();
    this.buildShow([]);
    this.buildHands();
  }

  buildPerformance() {
    this.figures = {};
    const figure = (name, label, title) => {
      this.figures[name] = make("b", {}, "–");
      return make("div", { title }, this.figures[name], make("span", {}, label));
    };
    const canvas = make("canvas", { class: "chart", title: "Milliseconds per stage of the last steps" });
    const list = make("div", { class: "stages" });
    this.chart = new Chart(canvas, list);
    this.performance.body.append(
      make(
        "div",
        { class: "figures" },
        figure("rate", "steps/s", "Steps per second of real time"),
        figure("cost", "ms per step", "Mean of the last steps"),
        figure("contacts", "contacts", "That carried a force in the last step"),
        figure("pairs", "pairs tested", "Triangle pairs that the exact test saw, of all pairs"),
      ),
      canvas,
      list,
    );
  }

  buildShow(fields) {
    const { app } = this;
    const select = make(
      "select",
      { id: "field", onchange: () => app.set({ field: select.value || null }) },
      make("option", { value: "" }, "the bodies' own"),
      ...fields.map((name) => make("option", { value: name }, FIELDS[name].name)),
    );
    select.value = app.view.field ?? "";
    const check = (name, label, title) => {
      const input = make("input", { type: "checkbox", onchange: () => app.set({ [name]: input.checked }) });
      input.checked = app.view[name];
      input.dataset.view = name;
      return make("label", { title }, input, label);
    };
    const opacity = make("input", { type: "range", min: 0.1, max: 1, step: 0.05, value: app.view.opacity, "aria-label": "Opacity of soft bodies" });
    opacity.oninput = () => app.set({ opacity: Number(opacity.value) });
    const range = make("input", { type: "range", min: -2, max: 0, step: "any", value: 0, "aria-label": "Range of the colours" });
    range.oninput = () => app.set({ range: 10 ** Number(range.value) });
    this.range = range;
    range.disabled = !app.view.field;
    const level = make("input", { type: "range", min: 0, max: DEEPEST, step: 1, value: app.view.level, "aria-label": "Level of the bounding trees" });
    level.oninput = () => app.set({ boxes: true, level: Number(level.value) });
    this.level = level;
    this.levelText = make("span", { class: "unit" });
    this.show.body.replaceChildren(
      make("div", { class: "row" }, make("label", { for: "field" }, "Colours"), select),
      make("div", { class: "row", title: "Less shows small values; what is above has the last colour" }, make("span", { class: "name" }, "Range"), range),
      make("div", { class: "row" }, make("span", { class: "name" }, "Opacity"), opacity),
      make(
        "div",
        { class: "checks" },
        ...(this.live ? [check("contacts", "Contacts", "Points and normals; the longer the stronger (C)"), check("touching", "Touching", "Triangles that meet (T)")] : []),
        check("wireframe", "Wireframe", "(W)"),
        check("boxes", "Boxes", "The box of each body (B)"),
        check("grid", "Ground", "Grid and shadow (G)"),
      ),
    );
    if (!app.can("levels")) return;
    const title = "How many splits below the box of the body, level 0 ([ and ])";
    this.show.body.append(
      make("div", { class: "row", title }, make("span", { class: "name" }, "Tree level"), make("div", { class: "field" }, level, this.levelText)),
    );
    this.tellLevel();
  }

  /** The level of the boxes and how many there are. */
  tellLevel(count) {
    const { boxes, level } = this.app.view;
    this.level.value = level;
    this.levelText.textContent = boxes && count !== undefined ? `${level}: ${whole(count)} boxes` : String(level);
  }

  buildHands() {
    const { view } = this.app;
    const range = (name, low, high, read, write, text) => {
      const value = make("span", { class: "unit" });
      const input = make("input", { type: "range", min: low, max: high, step: "any", value: write(view[name]), "aria-label": name });
      const tell = () => (value.textContent = text(view[name]));
      input.oninput = () => {
        view[name] = read(Number(input.value));
        tell();
      };
      tell();
      return make("div", { class: "field" }, input, value);
    };
    const depth = make("input", { type: "number", min: 0, step: "any", placeholder: "through", "aria-label": "Depth of a cut in mm" });
    depth.onchange = () => (view.cutDepth = depth.value === "" ? null : Number(depth.value) / 1000);
    const row = (name, field, feature) => Object.assign(make("div", { class: "row" }, make("span", { class: "name" }, name), field), { feature });
    this.handRows = [
      row("Spring", range("strength", -1.5, 1.5, (x) => 10 ** x, Math.log10, (x) => `${digits(x, 2)}×`), "pull"),
      row("Grip", range("grip", -0.7, 0.7, (x) => 10 ** x, Math.log10, (x) => `${digits(x, 2)}×`), "pull"),
      row("Probe", range("probe", -0.7, 0.7, (x) => 10 ** x, Math.log10, (x) => `${digits(x, 2)}×`), "tool"),
      row("Cut depth", make("div", { class: "field" }, depth, make("span", { class: "unit" }, "mm")), "cut"),
    ];
    const apart = make("button", { class: "plain", onclick: () => this.app.send({ type: "separate" }) }, "Pieces become bodies");
    apart.title = "What has come apart is then moved, shown and set on its own";
    this.handRows.push(row("After cuts", apart, "cut"));
    this.hands.body.append(
      ...this.handRows,
      make("p", { class: "hint" }, "Alt or the right button always moves the camera; while pulling or pushing, the wheel moves the hand in depth."),
    );
  }

  hello(header) {
    this.live = header.mode === "live";
    this.buildShow(header.fields ?? []);
    this.performance.element.hidden = this.hands.element.hidden = this.simulation.element.hidden = !this.live;
    for (const row of this.handRows) row.hidden = !header.features.includes(row.feature);
    if (this.handRows.every((row) => row.hidden)) this.hands.element.hidden = true;
  }

  /** The list of bodies; settings that a user has opened stay open. */
  scene() {
    const { app } = this;
    this.bodies.body.replaceChildren(
      ...app.stage.bodies.map((body, index) => {
        const swatch = make("input", { type: "color", class: "swatch", value: hex(body.look.color), title: "Colour", "aria-label": `Colour of ${body.look.name}` });
        swatch.oninput = () => {
          body.restyle({ color: fromHex(swatch.value) });
          app.stage.touch();
        };
        const eye = make("button", { class: "eye", title: "Show or hide", "aria-label": `Show ${body.look.name}`, "aria-pressed": body.visible });
        eye.append(icon(EYE));
        eye.onclick = () => {
          body.visible = !body.visible;
          eye.setAttribute("aria-pressed", body.visible);
          app.stage.touch();
        };
        const more = make("div", { class: "more", hidden: !this.open.has(body.look.name) });
        const what = body.look.rigid ? "rigid" : `${whole(body.look.nodes)} nodes`;
        const who = make("button", { class: "who", title: "Settings", "aria-expanded": !more.hidden }, body.look.name);
        who.onclick = () => {
          more.hidden = !more.hidden;
          who.setAttribute("aria-expanded", !more.hidden);
          this.open[more.hidden ? "delete" : "add"](body.look.name);
          this.fill(index);
        };
        const hidden = app.can("tool") && body.look.name === "viewer probe";
        const row = make("div", { class: "body", hidden }, make("div", { class: "top" }, swatch, who, make("span", { class: "what" }, what), eye), more);
        row.more = more;
        return row;
      }),
    );
    app.stage.bodies.forEach((_, index) => this.fill(index));
  }

  /** What stands below a body's name. */
  fill(index) {
    const { app } = this;
    const row = this.bodies.body.children[index];
    const body = app.stage.bodies[index];
    if (!row || row.more.hidden || row.more.contains(document.activeElement)) return;
    const opacity = make("input", { type: "range", min: 0.05, max: 1, step: 0.05, value: body.look.opacity, "aria-label": "Opacity" });
    opacity.oninput = () => {
      body.restyle({ opacity: Number(opacity.value) });
      app.stage.touch();
    };
    const rows = [make("div", { class: "row" }, make("span", { class: "name" }, "Opacity"), opacity)];
    const settings = app.state?.bodies?.[index];
    if (settings) {
      const number = (group, [name, label, unit, title]) => {
        const value = settings[group][name];
        const input = make("input", { type: "number", step: "any", value: value ?? "", placeholder: "chosen", "aria-label": label });
        input.onchange = () => {
          const given = input.value === "" ? null : Number(input.value);
          if (given === null && value !== null && group === "material") return;
          app.send({ type: "settings", body: index, [group]: { [name]: given } });
          input.blur();
        };
        return make("div", { class: "row", title }, make("span", { class: "name" }, label), make("div", { class: "field" }, input, make("span", { class: "unit" }, unit)));
      };
      if (!settings.rigid) {
        const law = settings.regions ? `${settings.law}, ${settings.regions} regions of their own` : settings.law;
        rows.push(make("div", { class: "row" }, make("span", { class: "name" }, "Law"), law));
        rows.push(...MATERIAL.map((each) => number("material", each)));
      }
      rows.push(...CONTACT.map((each) => number("contact", each)));
      if (!settings.rigid) {
        const self = make("input", { type: "checkbox", "aria-label": "Contact with itself" });
        self.checked = settings.contact.self_contact;
        self.onchange = () => app.send({ type: "settings", body: index, contact: { self_contact: self.checked } });
        rows.push(make("div", { class: "row" }, make("span", { class: "name" }, "Self-contact"), self));
      }
    }
    row.more.replaceChildren(...rows);
  }

  state(state) {
    if (!this.live) return;
    [...this.bodies.body.children].forEach((_, index) => this.fill(index));
    if (this.simulation.body.contains(document.activeElement)) return;
    const { app } = this;
    const step = make("input", { type: "number", step: "any", min: 0, value: Number((1e3 * state.time_step).toPrecision(5)), "aria-label": "Time step in ms" });
    step.onchange = () => {
      if (Number(step.value) > 0) app.send({ type: "settings", time_step: Number(step.value) / 1e3 });
      step.blur();
    };
    const axes = state.gravity.map((value, axis) => {
      const input = make("input", { type: "number", step: "any", value: Number(value.toPrecision(5)), "aria-label": `Gravity along ${"xyz"[axis]}` });
      input.onchange = () => app.send({ type: "settings", gravity: axes.map((each) => Number(each.value)) });
      return input;
    });
    this.simulation.body.replaceChildren(
      make("div", { class: "row" }, make("span", { class: "name" }, "Time step"), make("div", { class: "field" }, step, make("span", { class: "unit" }, "ms"))),
      make("div", { class: "row" }, make("span", { class: "name" }, "Gravity m/s²"), make("div", { class: "three" }, ...axes)),
      make("p", { class: "hint" }, "A change makes the simulation anew in its present state; cuts made before it cannot be undone."),
    );
  }

  /** The figures of a frame. */
  numbers(numbers) {
    const { figures, app } = this;
    const cost = numbers.possible_steps_per_second ? 1e3 / numbers.possible_steps_per_second : null;
    figures.rate.textContent = app.state?.playing ? digits(numbers.steps_per_second) : "paused";
    figures.cost.textContent = digits(cost ?? (numbers.times ? 1e3 * numbers.times.total : null));
    figures.contacts.textContent = whole(numbers.contacts);
    if (numbers.all_pairs) {
      figures.pairs.textContent = whole(numbers.pair_tests);
      figures.pairs.nextSibling.textContent = `of ${short(numbers.all_pairs)} pairs tested`;
    }
    this.chart.draw();
  }

  reflect(view) {
    this.element.querySelector("#field").value = view.field ?? "";
    this.range.value = Math.log10(view.range);
    this.range.disabled = !view.field;
    for (const input of this.element.querySelectorAll("[data-view]")) input.checked = view[input.dataset.view];
    if (this.app.can("levels")) this.tellLevel();
  }
}

/** The legend of the colours, with the range of the values. */
export function showLegend(element, field, high) {
  element.hidden = !field;
  if (!field) return;
  const { name, unit, note, ramp } = FIELDS[field];
  if (element.dataset.field !== field) {
    element.dataset.field = field;
    element.replaceChildren(
      make("b", {}, name),
      make("p", {}, note),
      Object.assign(make("div", { class: "ramp" }), { style: `background:${ramp.css}` }),
      make("div", { class: "ends" }, make("span", {}, "0"), make("span", {}), make("span", { title: "and more" })),
    );
  }
  const [, middle, end] = element.querySelector(".ends").children;
  middle.textContent = withUnit(high / 2, unit);
  end.textContent = `≥ ${withUnit(high, unit)}`;
}

function section(title, open) {
  const body = make("div");
  return { element: make("details", { open }, make("summary", {}, title), body), body };
}

function short(count) {
  const unit = [[1e9, " billion"], [1e6, " million"], [1e4, "k", 1e3]].find(([size]) => count >= size);
  return unit ? `${digits(count / (unit[2] ?? unit[0]))}${unit[1]}` : whole(count);
}

function hex(color) {
  return `#${color.map((value) => Math.round(255 * value).toString(16).padStart(2, "0")).join("")}`;
}

function fromHex(text) {
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
}
