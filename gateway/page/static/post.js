// Requests that change something. The server answers with the key of a text or with a text.

import {hasText, text} from "./texts.js";

const PATIENCE_MS = 10000;

// Return {ok, status, content}; without an answer, status is 0.
export async function post(path, content) {
  try {
    const response = await fetch(path, {
      method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(content), signal: AbortSignal.timeout(PATIENCE_MS),
    });
    return {ok: response.ok, status: response.status, content: await response.json()};
  } catch {
    return {ok: false, status: 0, content: {error: "no_answer"}};
  }
}

// Return why a request was not carried out.
export const reasonOf = ({content}) => (hasText(content.error ?? "") ? text(content.error, content) : content.text ?? text("no_answer"));
