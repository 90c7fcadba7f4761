// Plays a recording that lies in the page itself; speaks as the server would.

import { decode } from "palpate/protocol";

export class Recording {
  constructor(receive, change, element) {
    this.receive = receive;
    this.playing = true;
    this.speed = 1;
    this.frame = 0;
    this.load(element).then(() => change(true));
  }

  async load(element) {
    const packed = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
    element.remove();
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const buffer = await new Response(stream).arrayBuffer();
    // Messages one after the other, each after its length; the first two are hello and scene.
    const view = new DataView(buffer);
    const places = [];
    for (let at = 0; at < buffer.byteLength; ) {
      const size = view.getUint32(at, true);
      places.push([at + 4, size]);
      at += 4 + size;
    }
    this.messages = places.map(([at, size]) => decode(buffer, at, size));
    this.head = this.messages.filter((message) => message.header.type !== "frame");
    this.frames = this.messages.filter((message) => message.header.type === "frame");
    addDifferences(this.frames);
    this.times = this.frames.map((message) => message.header.time);
    this.version = null;
    this.receive(this.head.find((message) => message.header.type === "hello"));
    this.show(0);
    this.tell();
    requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    const last = this.times.length - 1;
    if (this.playing && last > 0) {
      if (this.clock === undefined) this.clock = this.times[this.frame];
      else this.clock += (Math.min(now - this.before, 100) / 1000) * (this.speed ?? 4);
      let next = this.frame;
      while (next < last && this.times[next + 1] <= this.clock) next++;
      if (next !== this.frame) this.show(next);
      if (next === last) {
        this.playing = false;
        this.tell();
      }
    }
    this.before = now;
    requestAnimationFrame((later) => this.tick(later));
  }

  show(frame) {
    this.frame = frame;
    const message = this.frames[frame];
    if (message.header.version !== this.version) {
      this.version = message.header.version;
      const scenes = this.head.filter((each) => each.header.type === "scene");
      this.receive(scenes.find((each) => each.header.version === this.version));
    }
    this.receive(message);
  }

  tell() {
    const { playing, speed } = this;
    this.receive({ header: { type: "state", playing, speed, bodies: [], undo: 0 }, arrays: {} });
  }

  send(command) {
    if (!this.frames) return;
    const last = this.frames.length - 1;
    if (command.type === "play") {
      this.playing = command.on;
      if (command.on && this.frame === last) this.show(0);
    } else if (command.type === "seek") {
      this.show(Math.min(command.frame, last));
    } else if (command.type === "step") {
      this.playing = false;
      this.show(Math.min(this.frame + command.count, last));
    } else if (command.type === "speed") {
      this.speed = command.value;
    } else if (command.type === "reset") {
      this.show(0);
    } else {
      return;
    }
    this.clock = this.times[this.frame];
    this.tell();
  }
}

/** Frames say how far nodes moved since the frame before; make them say where nodes are. */
function addDifferences(frames) {
  let before = null;
  for (const { header, arrays } of frames) {
    if (header.quantised.difference) {
      const places = arrays.positions.slice();
      for (let i = 0; i < places.length; i++) places[i] += before[i];
      arrays.positions = places;
    }
    before = arrays.positions;
  }
}
