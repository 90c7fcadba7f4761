// The WebSocket to the server: comes back by itself when it breaks.

import { decode } from "palpate/protocol";

export class Connection {
  /** `receive(message)` gets decoded messages, `change(open)` whether the server is there. */
  constructor(receive, change) {
    this.receive = receive;
    this.change = change;
    this.wait = 250;
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.wait = 250;
      this.change(true);
    };
    socket.onmessage = (event) => {
      const message = decode(event.data);
      if (message.header.type === "frame") this.send({ type: "ack", number: message.header.number });
      this.receive(message);
    };
    socket.onclose = () => {
      this.change(false);
      setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(2 * this.wait, 4000);
    };
    this.socket = socket;
  }

  send(command) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(command));
  }
}
