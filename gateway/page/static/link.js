// The connection to the page's server, and how old its data are.
//
// Data are stale when the connection is lost, when no push has come for `limitS`, or when pushes are late because of a slow
// connection. Lateness is the time from the server's clock to this one, less the difference of the two clocks. That is at most the
// smallest such time seen, but for the drift of the clocks; and as no push was made before it was asked for, it is at least what the
// time of the request tells, so that the first push already shows how late it is.

const SILENCE_MIN_S = 1.0, SILENCE_MAX_S = 1.5; // the server pushes four times a second
const DRIFT = 1e-4;
const RENEW_S = 5;

export const nowS = () => performance.now() / 1000;

export class Link {
  // `history` tells in a query what is there of the history.
  constructor(onHistory, onState, history = () => "") {
    this.handlers = {history: onHistory, state: onState};
    this.history = history;
    this.limitS = SILENCE_MAX_S;
    this.arrivedS = null;
    this.differenceS = -Infinity; // of the clocks, this one less the server's
    this.lateS = 0;
    this.open();
  }

  open() {
    this.openedS = this.askedS = nowS();
    this.connected = true;
    this.source = new EventSource(`api/events${this.history()}`);
    this.source.onopen = () => { this.connected = true; };
    this.source.onerror = () => { this.connected = false; this.askedS = nowS(); }; // the browser asks again
    this.source.addEventListener("history", (event) => this.handlers.history(JSON.parse(event.data)));
    this.source.addEventListener("state", (event) => this.receive(JSON.parse(event.data)));
    this.source.addEventListener("change", (event) => {
      const change = JSON.parse(event.data);
      this.receive({...this.state, ...change, topics: {...this.state.topics, ...change.topics}});
    });
  }

  receive(state) {
    const now = nowS();
    const driftS = this.arrivedS === null ? 0 : DRIFT * (now - this.arrivedS);
    const sinceMadeS = now - state.now_s;
    this.differenceS = Math.min(sinceMadeS, Math.max(this.differenceS + driftS, this.askedS - state.now_s));
    this.lateS = sinceMadeS - this.differenceS;
    this.arrivedS = now;
    this.limitS = Math.min(Math.max(state.page.stale_s, SILENCE_MIN_S), SILENCE_MAX_S);
    this.state = state;
    this.handlers.state(state);
  }

  // Return the time since the last push was made.
  ageS() {
    return nowS() - this.arrivedS + this.lateS;
  }

  // Return why the data may be out of date, as the key of a text and seconds; null if they are not.
  complaint() {
    const silentS = nowS() - (this.arrivedS ?? this.openedS);
    if (!this.connected) return {key: "page_gone"};
    if (silentS > this.limitS) return {key: "page_silent", seconds: silentS.toFixed(0)};
    if (silentS + this.lateS > this.limitS) return {key: "page_slow", seconds: (silentS + this.lateS).toFixed(0)};
    return null;
  }

  // Reconnect: EventSource stops after some errors, and does not detect a silent host. What waits on a slow connection is dropped.
  reconnect() {
    const waitedS = nowS() - Math.max(this.arrivedS ?? 0, this.openedS);
    const dead = this.source.readyState === EventSource.CLOSED && waitedS > 1;
    const isLate = this.lateS > this.limitS && nowS() - this.openedS > RENEW_S;
    if (!dead && !isLate && waitedS < RENEW_S) return;
    this.source.close();
    this.open();
    this.connected = false;
  }
}
