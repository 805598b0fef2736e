// The connection to the page's server, and whether its data are up to date.
//
// Data are stale when the connection is lost, when no push has come for `limitS`, or when pushes are late because of a slow
// connection. Lateness is the growth of the difference between this clock and the server's, beyond the drift of two clocks.

const SILENCE_MIN_S = 1.0, SILENCE_MAX_S = 1.5; // the server pushes four times a second
const DRIFT = 1e-4;
const RENEW_S = 5;

export const nowS = () => performance.now() / 1000;

export class Link {
  constructor(onHistory, onState) {
    this.handlers = {history: onHistory, state: onState};
    this.limitS = SILENCE_MAX_S;
    this.arrivedS = null;
    this.open();
  }

  open() {
    this.openedS = nowS();
    this.connected = true;
    this.offsetS = null;
    this.lateS = 0;
    this.source = new EventSource("api/events");
    this.source.onopen = () => { this.connected = true; this.offsetS = null; };
    this.source.onerror = () => { this.connected = false; };
    this.source.addEventListener("history", (event) => this.handlers.history(JSON.parse(event.data)));
    this.source.addEventListener("state", (event) => this.receive(JSON.parse(event.data)));
  }

  receive(state) {
    const now = nowS();
    const offsetS = now - state.now_s;
    const since = this.arrivedS === null ? 0 : now - this.arrivedS;
    this.offsetS = this.offsetS === null ? offsetS : Math.min(offsetS, this.offsetS + DRIFT * since);
    this.lateS = offsetS - this.offsetS;
    this.arrivedS = now;
    this.limitS = Math.min(Math.max(state.page.stale_s, SILENCE_MIN_S), SILENCE_MAX_S);
    this.handlers.state(state);
  }

  // Return why the data may be out of date, as the key of a text and seconds; null if they are not.
  complaint() {
    const silentS = nowS() - (this.arrivedS ?? this.openedS);
    if (!this.connected) return {key: "page_gone"};
    if (silentS > this.limitS) return {key: "page_silent", seconds: silentS.toFixed(0)};
    if (this.lateS > this.limitS) return {key: "page_slow", seconds: this.lateS.toFixed(0)};
    return null;
  }

  // Reconnect: EventSource stops after some errors, and does not detect a silent host.
  reconnect() {
    const waitedS = nowS() - Math.max(this.arrivedS ?? 0, this.openedS);
    const dead = this.source.readyState === EventSource.CLOSED && waitedS > 1;
    if (!dead && waitedS < RENEW_S) return;
    this.source.close();
    this.open();
    this.connected = false;
  }
}
