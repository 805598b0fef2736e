// What a person would see wrong on a page: text that is cut, outside the window or too small, and boxes that move.

const shown = (element) => !element.closest(".unseen, .symbols, svg") && element.checkVisibility();
const name = (element) => `${element.tagName} ${element.id || element.className}: ${element.textContent.trim().slice(0, 60)}`;
const texts = (element) => [...element.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim());
const BOXES = "#cards li, .tiles > div, .facts > div, section, header, .side, button, .doing, .next, dialog, main";
const SCROLLING = ".scroll, #title, #acknowledged, #acknowledge-as, #person"; // the list of alerts scrolls, and names may end in an ellipsis
const MOVING = ["title", "word", "sentence", "phi", "gauge", "tile-now", "tile-lean", "bullseye", "trend"];

function isClipped(element) {
  const clips = getComputedStyle(element).overflowY !== "visible" && !element.matches("#service-screen, #fleet, .track");
  return clips && (element.scrollWidth > element.clientWidth + 1 || element.scrollHeight > element.clientHeight + 2);
}

function isBeyondItsBox(element) {
  return texts(element).some((node) => {
    const range = document.createRange();
    range.selectNodeContents(node);
    const text = range.getBoundingClientRect(), box = element.closest(BOXES).getBoundingClientRect();
    return text.right > box.right + 1 || text.left < box.left - 1 || text.bottom > box.bottom + 2 || text.top < box.top - 2;
  });
}

function isOutside(element, acrossOnly) {
  const box = element.getBoundingClientRect();
  return box.right > innerWidth + 1 || box.left < -1 || (!acrossOnly && box.bottom > innerHeight + 1);
}

window.layout = {
  cut: () => [...document.body.querySelectorAll("*")]
    .filter((element) => shown(element) && !element.closest(SCROLLING) && (isClipped(element) || isBeyondItsBox(element)))
    .map(name),
  outside: (acrossOnly) => [...document.body.querySelectorAll("*")]
    .filter((element) => shown(element) && !element.closest(SCROLLING) && texts(element).length > 0 && isOutside(element, acrossOnly))
    .map(name),
  small: (smallestPx) => [...document.body.querySelectorAll("*")]
    .filter((element) => shown(element) && texts(element).length > 0 && parseFloat(getComputedStyle(element).fontSize) < smallestPx)
    .map(name),
  boxes: () => MOVING.map((id) => {
    const box = document.getElementById(id).getBoundingClientRect();
    return [id, Math.round(box.x), Math.round(box.y)];
  }),
};
