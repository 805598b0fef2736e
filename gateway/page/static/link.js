// The connection to the page server, and whether what comes through it is of now.
//
// Three things make it stale: the connection is gone, no push came for `limit_s`, or pushes come late (a backlog on a slow
// line). Lateness is the growth of the difference between this clock and the server's, beyond what two clocks drift.

const SILENCE_MIN_S = 1.0, SILENCE_MAX_S = 1.5; // the server pushes four times a second, whatever `stale_s` is
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

  // Why what is shown may not be of now; null while all is well.
  complaint() {
    const silentS = nowS() - (this.arrivedS ?? this.openedS);
    if (!this.connected) return "no connection to the gateway's page";
    if (silentS > this.limitS) return `nothing from the gateway's page for ${silentS.toFixed(0)} s`;
    if (this.lateS > this.limitS) return `the line is slow: what arrives is ${this.lateS.toFixed(0)} s old`;
    return null;
  }

  // EventSource gives up for good on some errors, and does not notice a host that fell silent.
  renew() {
    const waitedS = nowS() - Math.max(this.arrivedS ?? 0, this.openedS);
    const dead = this.source.readyState === EventSource.CLOSED && waitedS > 1;
    if (!dead && waitedS < RENEW_S) return;
    this.source.close();
    this.open();
    this.connected = false;
  }
}
