// Links: "#/valve/FV%2F1?from=1" is {name: 'valve', id: 'FV/1', query}.

// A link that somebody cut, as in "%E0%A4%A", is shown as it is.
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

export function parseRoute(hash) {
  const [path, query = ''] = hash.replace(/^#\/?/, '').split('?');
  const [name = '', id = ''] = path.split('/');
  return {name, id: decoded(id), query: new URLSearchParams(query)};
}

/** "?a=1&b=2"; what is null or empty is left out. */
export function queryText(query) {
  const words = new URLSearchParams(Object.entries(query).filter(
      ([, value]) => value !== null && value !== undefined && value !== ''));
  const text = String(words);
  return text && `?${text}`;
}

export function link(name, id = '', query = {}) {
  return `#/${name}${id ? '/' + encodeURIComponent(id) : ''}` +
      queryText(query);
}

/** Puts the choices of a view into the address without a new entry. */
export function rememberQuery(name, id, query) {
  history.replaceState(null, '', link(name, id, query));
}
