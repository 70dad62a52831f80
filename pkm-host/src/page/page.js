'use strict';
// What a report can do where scripts run; without them all of it can be read, and paper shows the same.
(() => {
  const SVG = 'http://www.w3.org/2000/svg';
  const FAR = 18; // pixels of a chart: a point farther away is not meant
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const numbers = text => text.split(' ').map(Number);

  const tip = document.createElement('div');
  tip.className = 'tip';
  tip.setAttribute('role', 'status');
  document.body.append(tip);

  // ---- points of a chart, in its own pixels, with words for each

  // A value that a pixel stands for, with the digits that a hundredth of a pixel has.
  const valueAt = ([low, high, from, to], at, logarithmic) => {
    const v = low + (at - from) / (to - from) * (high - low);
    if (logarithmic) return Number((10 ** v).toPrecision(3));
    const unit = 10 ** Math.floor(Math.log10(0.02 * Math.abs((high - low) / (to - from))));
    return Number((Math.round(v / unit) * unit).toPrecision(6));
  };
  // "θ in °: 3.2" or "residual, µm: 0.4"
  const said = (label, value) => `${label}: ${value}`;

  const pointsOfSeries = (chart, series) => {
    const { name, mark, place, keys } = series.dataset;
    const [lowX, highX, left, right, lowY, highY] = numbers(chart.dataset.axes);
    const [top, bottom] = numbers(place), logarithmic = chart.dataset.axes.endsWith('log');
    const offset = mark === 'cross' ? 4 : 0, key = keys?.split(' ');
    const path = series.querySelector('path')?.getAttribute('d') ?? '';
    const places = [...path.matchAll(/([ML])(-?[\d.]+),(-?[\d.]+)/g)].filter(m => mark !== 'vector' || m[1] === 'L');
    if (mark === 'band') return [];
    return places.map((m, n) => {
      const [x, y] = [+m[2] + offset, +m[3] + offset];
      const text = () => [name, said(chart.dataset.x, valueAt([lowX, highX, left, right], x, logarithmic)),
        said(chart.dataset.y, valueAt([lowY, highY, bottom, top], y, logarithmic)), key ? 'Enter or click: its row' : ''].filter(Boolean).join('; ');
      return { x, y, text, key: key?.[n], series };
    });
  };
  const pointsOfBars = chart => all('[data-series] > g', chart).map(bar => {
    const box = bar.querySelector('rect'), of = name => +box.getAttribute(name), text = bar.dataset.text;
    return { x: of('x') + of('width') / 2, y: of('y'), box: [of('x'), of('y'), of('width'), of('height')], text: () => text, series: bar.parentNode };
  });
  const pointsOfMap = chart => {
    const [lowX, highX, left, right, lowY, highY] = numbers(chart.dataset.axes), [top, bottom] = numbers(chart.dataset.place);
    const rows = chart.dataset.values.split('|').map(row => row.split(' '));
    return rows.flatMap((row, r) => row.map((value, c) => {
      const x = left + (right - left) * (c + 0.5) / row.length, y = bottom - (bottom - top) * (r + 0.5) / rows.length;
      const text = () => `${chart.dataset.name}: ${value.replace('*', ' (extrapolated)')}; ${said(chart.dataset.x, valueAt([lowX, highX, left, right], x))}; ${said(chart.dataset.y, valueAt([lowY, highY, bottom, top], y))}`;
      return { x, y, text, value };
    })).filter(point => point.value !== '-');
  };
  const known = new Map();
  const pointsOf = chart => {
    if (!known.has(chart)) known.set(chart, chart.matches('.bars') ? pointsOfBars(chart) : chart.matches('.heat') ? pointsOfMap(chart)
      : all('[data-series]', chart).flatMap(series => pointsOfSeries(chart, series)));
    return known.get(chart).filter(point => !point.series || point.series.style.display !== 'none');
  };

  // ---- what is shown of a point

  const rings = [];
  const ring = (chart, { x, y }) => {
    const circle = document.createElementNS(SVG, 'circle');
    for (const [name, value] of Object.entries({ cx: x, cy: y, r: 7, fill: 'none', stroke: '#000000', 'stroke-width': 2.5, 'pointer-events': 'none' })) circle.setAttribute(name, value);
    chart.append(circle);
    rings.push(circle);
  };
  let shown = null;
  const hide = () => { tip.textContent = ''; shown?.ring.remove(); shown = null; };
  const show = (chart, point) => {
    if (shown?.point === point) return;
    hide();
    ring(chart, point);
    shown = { chart, point, ring: rings.pop() };
    tip.textContent = point.text();
    const at = new DOMPoint(point.x, point.y).matrixTransform(chart.getScreenCTM()), box = tip.getBoundingClientRect();
    tip.style.left = `${Math.max(4, Math.min(innerWidth - box.width - 4, at.x + 12))}px`;
    tip.style.top = `${at.y > box.height + 20 ? at.y - box.height - 12 : at.y + 16}px`;
  };

  // ---- from a row to its points and back

  const buttons = new Map();
  const choose = key => {
    rings.splice(0).forEach(circle => circle.remove());
    all('tr.chosen').forEach(row => row.classList.remove('chosen'));
    all(`tr[data-key="${key}"]`).forEach(row => row.classList.add('chosen'));
    let first = null;
    for (const chart of all('.chart')) for (const point of pointsOf(chart)) if (point.key === key) { ring(chart, point); first ??= { chart, point }; }
    return first;
  };
  const toRow = key => {
    choose(key);
    const button = buttons.get(key);
    if (!button) return;
    for (let e = button; e; e = e.parentElement) if (e.tagName === 'DETAILS') e.open = true;
    hide();
    button.scrollIntoView({ block: 'center' });
    button.focus({ preventScroll: true });
  };
  const toPoint = key => {
    const first = choose(key);
    if (!first) return;
    const svg = first.chart.closest('svg');
    svg.scrollIntoView({ block: 'center' });
    svg.focus({ preventScroll: true });
    show(first.chart, first.point);
  };
  // a reading without a force has no point
  const drawn = new Set(all('.chart').flatMap(chart => pointsOf(chart).map(point => point.key)));
  for (const row of all('tr[data-key]').filter(row => drawn.has(row.dataset.key))) {
    const head = row.querySelector('th'), button = document.createElement('button');
    button.type = 'button';
    button.append(...head.childNodes);
    button.title = 'show it in the charts';
    button.addEventListener('click', () => toPoint(row.dataset.key));
    head.append(button);
    if (!buttons.has(row.dataset.key)) buttons.set(row.dataset.key, button);
  }

  // ---- pointer and keys on charts

  for (const svg of all('svg')) {
    const charts = all('.chart, .bars, .heat', svg);
    if (!charts.length) continue;
    // what is inside can be reached now: it is no mere image any more
    svg.setAttribute('role', 'group');
    svg.setAttribute('aria-label', `${svg.querySelector('title').textContent}. Arrow keys go from point to point.`);
    svg.querySelector('title').remove();
    svg.tabIndex = 0;
    for (const bar of all('[data-series] > g', svg)) {
      const title = bar.querySelector('title');
      if (title) { bar.dataset.text = title.textContent; title.remove(); }
    }
    const nearest = event => {
      for (const chart of charts) {
        const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(chart.getScreenCTM().inverse());
        let best = null, least = FAR;
        for (const point of pointsOf(chart)) {
          const [x, y, width, height] = point.box ?? [];
          const inside = point.box && at.x >= x && at.x <= x + width && at.y >= y && at.y <= y + height;
          const far = inside ? 0 : Math.hypot(point.x - at.x, point.y - at.y);
          if (far < least) { least = far; best = point; }
        }
        if (best) return { chart, point: best };
      }
      return null;
    };
    svg.addEventListener('pointermove', event => { const found = nearest(event); if (found) show(found.chart, found.point); else hide(); });
    svg.addEventListener('pointerleave', hide);
    svg.addEventListener('blur', hide);
    svg.addEventListener('click', event => { const found = nearest(event); if (found?.point.key) toRow(found.point.key); });
    svg.addEventListener('keydown', event => {
      if (event.target !== svg) return;
      const to = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (event.key === 'Escape') hide();
      if (event.key === 'Enter' && shown?.point.key) { event.preventDefault(); toRow(shown.point.key); }
      if (!to) return;
      event.preventDefault();
      const chart = shown && charts.includes(shown.chart) ? shown.chart : charts[0], points = pointsOf(chart);
      let best = shown?.chart === chart ? null : points[0], least = Infinity;
      if (!best) for (const point of points) {
        const [dx, dy] = [point.x - shown.point.x, point.y - shown.point.y];
        const ahead = dx * to[0] + dy * to[1], aside = Math.abs(dx * to[1] + dy * to[0]);
        if (ahead > 0.01 && ahead + 3 * aside < least) { least = ahead + 3 * aside; best = point; }
      }
      if (best) show(chart, best);
    });
  }
  addEventListener('scroll', hide, { passive: true });

  // ---- series on and off: in all charts of a figure that have one of the name

  for (const entry of all('[data-legend]')) {
    const name = entry.querySelector('text').textContent, figure = entry.closest('figure') ?? entry.closest('svg');
    entry.tabIndex = 0;
    entry.setAttribute('role', 'button');
    entry.setAttribute('aria-pressed', 'true');
    const toggle = () => {
      const on = entry.getAttribute('aria-pressed') === 'false';
      for (const other of all('[data-legend]', figure).filter(o => o.querySelector('text').textContent === name)) {
        other.setAttribute('aria-pressed', on);
        const own = all(`[data-series="${other.dataset.legend}"]`, other.closest('.chart, .bars'));
        own.forEach(series => { series.style.display = on ? '' : 'none'; });
      }
      hide();
    };
    entry.addEventListener('click', event => { event.stopPropagation(); toggle(); });
    entry.addEventListener('keydown', event => { if (event.key === 'Enter' || event.key === ' ') { event.preventDefault(); toggle(); } });
  }

  // ---- tables sorted by a column: all parts of a table that is cut into several

  // Words come after numbers.
  const compare = (a, b) => {
    const [x, y] = [a, b].map(text => parseFloat(text.replace('−', '-')));
    if (Number.isFinite(x) !== Number.isFinite(y)) return Number.isFinite(x) ? -1 : 1;
    return Number.isFinite(x) ? x - y : a.localeCompare(b);
  };
  for (const figure of all('figure.table')) {
    const tables = all('table', figure);
    if (tables[0].tBodies[0].rows.length < 2) continue;
    for (const table of tables) for (const head of all('thead th', table).filter(head => head.textContent)) {
      const button = document.createElement('button');
      button.type = 'button';
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener('click', () => {
        const down = head.getAttribute('aria-sort') !== 'descending', rows = [...table.tBodies[0].rows];
        const order = rows.map((row, n) => [row.cells[head.cellIndex].textContent, n]).sort((a, b) => compare(a[0], b[0]) * (down ? -1 : 1));
        for (const each of tables) {
          const own = [...each.tBodies[0].rows];
          each.tBodies[0].append(...order.map(([, n]) => own[n]));
          all('thead th', each).forEach(other => other.removeAttribute('aria-sort'));
        }
        head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
      });
    }
  }
})();
