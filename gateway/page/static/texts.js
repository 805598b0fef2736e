// The texts of the page, `gateway/languages`, in the language that its address names (`/?lang=de`), or else in that of the server.

const chosen = new URLSearchParams(window.location.search).get("lang");
const {LANGUAGE, TEXTS} = await import(`./language.js${chosen === null ? "" : `?lang=${encodeURIComponent(chosen)}`}`);

document.documentElement.lang = LANGUAGE;
for (const element of document.querySelectorAll("[data-text]")) element.textContent = text(element.dataset.text);

// Load the page anew, once, where the server has changed its language meanwhile.
export function followLanguage(language) {
  if (chosen !== null || language === LANGUAGE || sessionStorage.getItem("language") === language) return;
  sessionStorage.setItem("language", language);
  window.location.reload();
}

// Return the text of a key, with its places filled.
export function text(key, values = {}) {
  const found = TEXTS[key];
  if (found === undefined) throw new Error(`no text ${key}`);
  return found.replace(/\{(\w+)\}/g, (_, name) => values[name]);
}

// Return whether a key has a text.
export const hasText = (key) => key in TEXTS;

// Return the name of a part of the gateway.
export const partName = (part) => (hasText(`part_${part}`) ? text(`part_${part}`) : part);
