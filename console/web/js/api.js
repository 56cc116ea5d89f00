// The monitor's HTTP interface.

import {queryText} from './route.js';

const kBase = 'api/v1';

export class ApiError extends Error {
  constructor(status, message, retryAfterS = null) {
    super(message);
    this.status = status;
    this.retryAfterS = retryAfterS;
  }
}

export const url = (path, query = {}) => kBase + path + queryText(query);

/** "/valves/FV%2F1/trend" from ['valves', 'FV/1', 'trend'] */
export function path(...words) {
  return words.map((word) => '/' + encodeURIComponent(word)).join('');
}

export async function errorOf(response) {
  let message = `the monitor answered ${response.status}`;
  try {
    message = (await response.json()).error ?? message;
  } catch {
    // Not ours: the status has to do.
  }
  const retry = Number(response.headers.get('Retry-After'));
  return new ApiError(response.status, message, retry || null);
}

async function request(address, options) {
  let response;
  try {
    response = await fetch(address, {cache: 'no-store', ...options});
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new ApiError(0, 'the monitor does not answer');
  }
  if (!response.ok) throw await errorOf(response);
  return response;
}

/** What the last answers from a plant's history left out, by path. */
export const notes = new Map();

export async function get(where, query, signal) {
  const timeout = AbortSignal.timeout(15000);
  try {
    const response = await request(url(where, query), {
      signal: signal && AbortSignal.any ? AbortSignal.any([signal, timeout]) :
        timeout,
    });
    const answer = await response.json();
    if (answer?.note) notes.set(where, answer.note);
    else notes.delete(where);
    return answer;
  } catch (error) {
    if (error.status === 401) location.reload();  // The proxy asks again.
    throw error;
  }
}

/** Null instead of an error where there is nothing of that name. */
export async function getOptional(where, query) {
  try {
    return await get(where, query);
  } catch (error) {
    if (error.status === 404) return null;
    throw error;
  }
}

export async function post(where, body) {
  const response = await request(url(where), {
    method: 'POST',
    headers: {'Content-Type': 'application/json'},
    body: JSON.stringify(body),
  });
  return response.json();
}
