// The shapes of the verdicts, for `<use href="#shape-...">`.

const SYMBOLS = `<svg xmlns="http://www.w3.org/2000/svg" class="symbols" aria-hidden="true">
    <symbol id="shape-circle" viewBox="0 0 100 100">
      <circle class="ring" cx="50" cy="50" r="42"/><path class="mark" d="M30 52l14 15 27-33"/>
    </symbol>
    <symbol id="shape-ring" viewBox="0 0 100 100">
      <circle class="ring" cx="50" cy="50" r="42"/>
    </symbol>
    <symbol id="shape-triangle" viewBox="0 0 100 100">
      <path class="solid" d="M50 5L98 92H2z"/><path class="cut" d="M50 36v27M50 76v4"/>
    </symbol>
    <symbol id="shape-octagon" viewBox="0 0 100 100">
      <path class="solid" d="M31 4h38l27 27v38L69 96H31L4 69V31z"/><path class="cut" d="M50 22v36M50 74v4"/>
    </symbol>
    <symbol id="shape-hourglass" viewBox="0 0 100 100">
      <path class="solid" d="M14 4h72v14L60 50l26 32v14H14V82l26-32-26-32z"/><path class="cut" d="M32 20h36M40 80h20"/>
    </symbol>
    <symbol id="shape-empty" viewBox="0 0 100 100">
      <rect class="outline" x="8" y="8" width="84" height="84"/><path class="outline" d="M30 50h40"/>
    </symbol>
    <symbol id="shape-slash" viewBox="0 0 100 100">
      <path class="solid" d="M50 2l48 48-48 48L2 50z"/><path class="cut" d="M34 66l32-32M40 34l26 26"/>
    </symbol>
    <symbol id="shape-mask" viewBox="0 0 100 100">
      <path class="solid" d="M50 2l48 48-48 48L2 50z"/><path class="cut" d="M24 46h22M54 46h22M40 66h20"/>
    </symbol>
    <symbol id="shape-pause" viewBox="0 0 100 100">
      <path class="solid" d="M50 2l48 48-48 48L2 50z"/><path class="cut" d="M40 34v32M60 34v32"/>
    </symbol>
    <symbol id="shape-zigzag" viewBox="0 0 100 100">
      <path class="solid" d="M50 2l48 48-48 48L2 50z"/><path class="cut" d="M22 52l12-14 12 24 12-24 10 22 10-12"/>
    </symbol>
    <symbol id="shape-question" viewBox="0 0 100 100">
      <path class="solid" d="M50 2l48 48-48 48L2 50z"/>
      <path class="cut" d="M38 40c0-18 26-17 25 0-1 10-13 9-13 21M50 73v3"/>
    </symbol>
    <symbol id="sound-on" viewBox="0 0 100 100">
      <path class="speaker" d="M26 36h20l26-24v76L46 64H26z"/>
    </symbol>
    <symbol id="sound-sounding" viewBox="0 0 100 100">
      <path class="speaker" d="M8 36h20l26-24v76L28 64H8z"/><path class="wave" d="M66 34q14 16 0 32M78 20q26 30 0 60"/>
    </symbol>
    <symbol id="sound-off" viewBox="0 0 100 100">
      <path class="speaker" d="M8 36h20l26-24v76L28 64H8z"/><path class="wave" d="M66 36l26 28M92 36L66 64"/>
    </symbol>
</svg>`;

// Put the symbols into the document.
export function addSymbols() {
  document.body.prepend(new DOMParser().parseFromString(SYMBOLS, "image/svg+xml").documentElement);
}
