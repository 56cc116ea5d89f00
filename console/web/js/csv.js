// Tables to save.

// A text that a spreadsheet would run as a formula gets a quote in front, as in
// the CSV of the programs.
export function csvOf(names, rows) {
  const cell = (value) => {
    const text = String(value ?? '');
    const formula = typeof value === 'string' &&
      /^'*[=+\-@\t\r]./s.test(text) &&
      !Number.isFinite(Number(text.replace(/^'+/, '')));
    const safe = formula ? `'${text}` : text;
    return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
  };
  return [names, ...rows.map((row) => names.map((name) => row[name]))]
      .map((cells) => cells.map(cell).join(',')).join('\n') + '\n';
}
