// What the mouse does to the scene: pull, push, cut. The camera keeps what these leave.

import { Plane, Raycaster, Vector2, Vector3 } from "three";

/** Radius of what a hand holds, in sizes of the scene. */
const HOLD = 0.035;

let nextGrip = 1;

export class Pointer {
  /** `send` takes commands; `app.mode` is look, pull, push or cut; `app.features` what the core can do. */
  constructor(stage, app) {
    this.stage = stage;
    this.app = app;
    this.caster = new Raycaster();
    this.active = null;
    const { container } = stage;
    this.lines = container.querySelectorAll("#stroke polyline");
    const listen = (name, action) => container.addEventListener(name, action, { capture: true });
    listen("pointerdown", (event) => this.down(event));
    listen("pointermove", (event) => this.moved(event));
    for (const name of ["pointerup", "pointercancel"]) listen(name, (event) => this.up(event));
    listen("wheel", (event) => this.wheel(event));
    addEventListener("blur", () => this.cancel());
  }

  ray(event) {
    const { left, top, width, height } = this.stage.canvas.getBoundingClientRect();
    const at = new Vector2(((event.clientX - left) / width) * 2 - 1, 1 - ((event.clientY - top) / height) * 2);
    this.caster.setFromCamera(at, this.stage.camera);
    return this.caster.ray;
  }

  /** The nearest visible body under the pointer: {body, point [m], face} or null. */
  pick(event, softOnly = true) {
    this.ray(event);
    const bodies = this.stage.bodies.filter((body) => body.visible && !(softOnly && body.look.rigid));
    const [hit] = this.caster.intersectObjects(bodies, false);
    if (!hit) return null;
    return { body: hit.object, face: hit.face, world: hit.point, point: this.stage.world.worldToLocal(hit.point.clone()) };
  }

  down(event) {
    if (event.button !== 0 || event.altKey || this.active) return;
    const start = { pull: () => this.startPull(event), push: () => this.startPush(event), cut: () => this.startCut(event) }[this.app.mode];
    this.active = start?.() ?? null;
    if (!this.active) return;
    event.stopPropagation();
    event.preventDefault();
    this.pointer = event.pointerId;
    this.stage.container.setPointerCapture(event.pointerId);
    this.stage.container.dataset.busy = "";
  }

  moved(event) {
    if (this.active && event.pointerId === this.pointer) {
      event.stopPropagation();
      this.last = event;
      this.pending ??= requestAnimationFrame(() => {
        this.pending = undefined;
        this.active?.move(this.last);
      });
    } else if (!event.buttons && this.app.mode === "pull") {
      // Looking for what is under the pointer costs a search: not more often than the eye sees.
      if (event.timeStamp - (this.looked ?? 0) < 80) return;
      this.looked = event.timeStamp;
      this.stage.container.dataset.over = this.pick(event) ? "tissue" : "";
    }
  }

  up(event) {
    if (!this.active || event.pointerId !== this.pointer) return;
    event.stopPropagation();
    this.active.move(event);
    this.finish((active) => active.end());
  }

  cancel() {
    if (this.active) this.finish((active) => (active.cancel ?? active.end)());
  }

  wheel(event) {
    if (!this.active?.wheel) return;
    event.stopPropagation();
    event.preventDefault();
    this.active.wheel(event.deltaY);
  }

  finish(action) {
    const { active } = this;
    this.active = null;
    delete this.stage.container.dataset.busy;
    action(active);
  }

  /** A spring from the node under the pointer; the hand moves in the plane that faces the camera. */
  startPull(event) {
    if (!this.app.can("pull")) return null;
    const hit = this.pick(event);
    if (!hit) return null;
    const { stage, app } = this;
    const { node, at } = hit.body.nearestNode(hit.face, hit.point);
    const world = stage.world.localToWorld(new Vector3(...at));
    const offset = world.clone().sub(hit.world);
    const normal = stage.camera.getWorldDirection(new Vector3());
    const plane = new Plane().setFromNormalAndCoplanarPoint(normal, hit.world);
    const grip = nextGrip++;
    const target = (pointer) => {
      const on = this.ray(pointer).intersectPlane(plane, new Vector3());
      return on ? stage.world.worldToLocal(on.add(offset)).toArray() : null;
    };
    app.send({ type: "grab", grip, body: stage.bodies.indexOf(hit.body), node, target: Array.from(at), strength: app.view.strength, radius: HOLD * stage.size * app.view.grip });
    return {
      move: (pointer) => {
        const to = target(pointer);
        if (to) app.send({ type: "drag", grip, target: to });
      },
      wheel: (delta) => plane.translate(normal.clone().multiplyScalar(-delta * 0.0006)),
      end: () => app.send({ type: "release", grip }),
    };
  }

  /** The probe goes in along the line of sight while the button is held; the wheel presses deeper. */
  startPush(event) {
    if (!this.app.can("tool")) return null;
    const hit = this.pick(event);
    if (!hit) return null;
    const { stage, app } = this;
    const radius = 0.02 * stage.size * app.view.probe;
    const normal = stage.camera.getWorldDirection(new Vector3());
    const plane = new Plane().setFromNormalAndCoplanarPoint(normal, hit.world);
    const started = performance.now();
    let depth = 0;
    let last = event;
    const aim = () => {
      const ray = this.ray(last);
      const on = ray.intersectPlane(plane, new Vector3());
      if (!on) return;
      // From just in front of the surface, half a second to a radius inside, then as the wheel says.
      const held = Math.min((performance.now() - started) / 500, 1);
      const scale = 2 / stage.size;
      on.addScaledVector(ray.direction, ((2 * held - 1) * radius + depth) * scale);
      const tip = stage.world.worldToLocal(on);
      // Held from the upper right, so that one sees where it touches.
      const [right, up] = [0, 1].map((column) => new Vector3().setFromMatrixColumn(stage.camera.matrixWorld, column));
      const ahead = ray.direction.clone().multiplyScalar(0.7).addScaledVector(up, -0.6).addScaledVector(right, -0.4).normalize();
      ahead.applyQuaternion(stage.world.quaternion.clone().invert());
      app.send({ type: "tool", tip: tip.toArray(), direction: ahead.toArray(), radius });
    };
    const timer = setInterval(aim, 30);
    aim();
    return {
      move: (pointer) => {
        last = pointer;
        aim();
      },
      wheel: (delta) => {
        depth -= delta * 0.0004 * stage.size;
      },
      end: () => {
        clearInterval(timer);
        app.send({ type: "tool_away" });
      },
    };
  }

  /** A blade that follows the pointer; it reaches along the line of sight through the tissue. */
  startCut(event) {
    if (!this.app.can("cut")) return null;
    const { stage, app } = this;
    const points = [];
    const edges = [];
    let depth = null;
    const add = (pointer) => {
      const before = points.at(-1);
      if (before && Math.hypot(pointer.clientX - before[0], pointer.clientY - before[1]) < 6) return;
      const hit = this.pick(pointer);
      const ray = this.ray(pointer);
      points.push([pointer.clientX, pointer.clientY]);
      const scale = 2 / stage.size;
      const distance = hit ? hit.world.distanceTo(ray.origin) : null;
      if (distance !== null) depth = depth === null ? distance : Math.min(depth, distance);
      edges.push({ origin: ray.origin.clone(), direction: ray.direction.clone(), distance, scale });
      draw();
    };
    const draw = () => this.lines.forEach((line) => line.setAttribute("points", points.join(" ")));
    const clear = () => this.lines.forEach((line) => line.removeAttribute("points"));
    add(event);
    return {
      move: (pointer) => (pointer.getCoalescedEvents?.().length ? pointer.getCoalescedEvents() : [pointer]).forEach(add),
      cancel: clear,
      end: () => {
        clear();
        if (edges.length < 2 || depth === null) {
          app.toast("Draw the stroke across tissue");
          return;
        }
        app.send({ type: "cut", edges: this.bladeEdges(edges, depth) });
      },
    };
  }

  /** The ends [m] of the blade's edge at each sample: from before the tissue to its depth, or through. */
  bladeEdges(samples, nearest) {
    const { stage, app } = this;
    const scale = 2 / stage.size;
    const through = app.view.cutDepth === null;
    let distance = null;
    return samples.map((sample) => {
      distance = sample.distance ?? distance ?? nearest;
      const from = through ? nearest - 0.3 * stage.size * scale : distance - 0.05 * stage.size * scale;
      const to = through ? nearest + 2.5 * stage.size * scale : distance + app.view.cutDepth * scale;
      return [from, to].map((along) =>
        stage.world.worldToLocal(sample.origin.clone().addScaledVector(sample.direction, along)).toArray(),
      );
    });
  }
}
