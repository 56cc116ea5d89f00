// Links: "#/valve/FV%2F1?from=1" is {name: 'valve', id: 'FV/1', query}.

export function parseRoute(hash) {
  const [path, query = ''] = hash.replace(/^#\/?/, '').split('?');
  const [name = '', id = ''] = path.split('/');
  return {name, id: decodeURIComponent(id), query: new URLSearchParams(query)};
}

export function link(name, id = '', query = {}) {
  const words = new URLSearchParams();
  for (const [key, value] of Object.entries(query)) {
    if (value !== null && value !== undefined && value !== '') {
      words.set(key, value);
    }
  }
  const text = words.toString();
  return `#/${name}${id ? '/' + encodeURIComponent(id) : ''}` +
      (text ? '?' + text : '');
}

/** Puts the choices of a view into the address without a new entry. */
export function rememberQuery(name, id, query) {
  history.replaceState(null, '', link(name, id, query));
}
