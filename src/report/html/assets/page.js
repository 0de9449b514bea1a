// The script of the HTML report: theme, download, slider, search, and what the 3D pane shows. Names are only ever set
// as text.
(() => {
  'use strict';
  const byId = (id) => document.getElementById(id);
  const dataOf = (id) => (byId(id) ? JSON.parse(byId(id).textContent) : null);
  const number = (value) => value.toLocaleString('en-US');
  const counted = (count, what) => `${number(count)} ${what}${count === 1 ? '' : 's'}`;

  function element(name, properties, ...children) {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
  }

  const bdi = (text) => element('bdi', { textContent: text });

  // --- theme ---------------------------------------------------------------------------------------------------------

  function startTheme() {
    const root = document.documentElement;
    const button = byId('theme');
    const prefersDark = matchMedia('(prefers-color-scheme: dark)');
    const isDark = () => (root.dataset.theme ?? (prefersDark.matches ? 'dark' : 'light')) === 'dark';
    const say = () => {
      button.textContent = isDark() ? 'Light colours' : 'Dark colours';
      document.dispatchEvent(new Event('theme'));
    };
    button.hidden = false;
    button.addEventListener('click', () => {
      root.dataset.theme = isDark() ? 'light' : 'dark';
      say();
    });
    prefersDark.addEventListener('change', say);
    say();
  }

  // --- download ------------------------------------------------------------------------------------------------------

  function startDownload() {
    const button = byId('download');
    if (!button) return;
    button.hidden = false;
    button.addEventListener('click', () => {
      const text = `${JSON.stringify(dataOf('report'), null, 2)}\n`;
      const address = URL.createObjectURL(new Blob([text], { type: 'application/json' }));
      element('a', { href: address, download: button.dataset.name }).click();
      setTimeout(() => URL.revokeObjectURL(address), 10_000);
    });
  }

  // --- pictures ------------------------------------------------------------------------------------------------------

  function startPictures() {
    for (const compare of document.querySelectorAll('.compare')) {
      const slider = compare.querySelector('input');
      slider?.addEventListener('input', () => compare.style.setProperty('--share', `${slider.value}%`));
    }
    const show = (id) => {
      for (const picture of document.querySelectorAll('.picture')) picture.hidden = picture.id !== `picture-${id}`;
    };
    const radios = [...document.querySelectorAll('input[name="picture"]')];
    for (const radio of radios) radio.addEventListener('change', () => show(radio.value));
    const checked = radios.find((radio) => radio.checked);
    if (checked) show(checked.value);
  }

  // --- rounds --------------------------------------------------------------------------------------------------------

  /// Steps through the rounds of `overlap`: a line in their chart, and their numbers from its table.
  function startRounds() {
    const slider = byId('round');
    if (!slider) return;
    const figure = slider.closest('figure');
    const cellsOf = (row) => [...row.cells].map((cell) => cell.textContent);
    const [[, ...names], ...rounds] = [...figure.querySelectorAll('tr')].map(cellsOf);
    const cursor = figure.querySelector('.cursor');
    const last = rounds.length - 1;
    const width = figure.querySelector('svg').viewBox.baseVal.width - 100;
    const say = () => {
      const [round, ...values] = rounds[slider.value];
      const words = names.map((name, at) => (name ? `${name} ${values[at]}` : values[at]));
      byId('of-round').textContent = `${round} of ${last}: ${words.filter(Boolean).join(', ')}`;
      cursor.setAttribute('transform', `translate(${(width * round) / last})`);
    };
    slider.parentElement.hidden = false;
    slider.value = Math.max(0, rounds.findIndex((cells) => cells.at(-1) === 'taken'));
    slider.addEventListener('input', say);
    say();
  }

  // --- groups and objects --------------------------------------------------------------------------------------------

  /// Which groups of the output hold which objects of the input.
  class Provenance {
    constructor(scene) {
      this.objects = scene.objects.names;
      this.groups = new Map((scene.after ?? scene.before).groups.map((group) => [group.id, group]));
      this.objectsOf = new Map();
      this.groupsOf = new Map();
      for (const [group, object, triangles] of scene.links.links) {
        this.add(this.objectsOf, group, { object, triangles });
        this.add(this.groupsOf, object, { group, triangles });
      }
    }

    add(map, key, value) {
      if (!map.has(key)) map.set(key, []);
      map.get(key).push(value);
    }

    groupName(id) {
      return this.groups.get(id)?.name ?? `group ${id}`;
    }

    objectName(id) {
      return this.objects[id] ?? `object ${id}`;
    }
  }

  const MOST_LISTED = 50;

  /// A list of lines, cut after some.
  function listed(lines, what) {
    const list = element('ul', {}, ...lines.slice(0, MOST_LISTED).map((line) => element('li', {}, ...line)));
    if (lines.length > MOST_LISTED) {
      list.append(element('li', { className: 'small', textContent: `and ${counted(lines.length - MOST_LISTED, what)} more` }));
    }
    return list;
  }

  /// What a group holds: its numbers and objects.
  function describedGroup(provenance, group, side) {
    const held = side.isLast ? (provenance.objectsOf.get(group.id) ?? []) : [];
    const most = [...held].sort((a, b) => b.triangles - a.triangles);
    const lines = most.map(({ object, triangles }) => [
      bdi(provenance.objectName(object)),
      `: ${counted(triangles, 'triangle')}`,
    ]);
    const placed = `${counted(group.triangles, 'triangle')}, placed ${number(group.placed)} time${group.placed === 1 ? '' : 's'}`;
    const described = [element('p', {}, element('b', {}, bdi(group.name))), element('p', { textContent: placed })];
    if (lines.length > 0) {
      described.push(element('p', { textContent: `It holds triangles of ${counted(lines.length, 'object')}:` }));
      described.push(listed(lines, 'object'));
    }
    return described;
  }

  function startSearch(provenance, scene, selectGroup) {
    const found = byId('found');
    const groupButton = (id) => {
      const button = element('button', { type: 'button', className: 'link' }, bdi(provenance.groupName(id)));
      button.addEventListener('click', () => selectGroup(id));
      return button;
    };
    const lineOfObject = (object) => {
      const groups = provenance.groupsOf.get(object) ?? [];
      const parts = groups.slice(0, 10).flatMap(({ group, triangles }) => [
        groupButton(group),
        ` (${counted(triangles, 'triangle')}) `,
      ]);
      const more = groups.length > 10 ? [`and ${counted(groups.length - 10, 'group')} more`] : [];
      const none = groups.length === 0 ? ['no group that is listed here'] : [];
      return ['object ', element('b', {}, bdi(provenance.objectName(object))), ' is in ', ...parts, ...more, ...none];
    };
    const lineOfGroup = (group) => {
      const held = provenance.objectsOf.get(group.id) ?? [];
      return ['group ', groupButton(group.id), ` holds ${counted(group.triangles, 'triangle')} of ${counted(held.length, 'object')}`];
    };
    const update = () => {
      const wanted = byId('search').value.trim().toLowerCase();
      if (wanted === '') {
        found.replaceChildren(element('p', { className: 'small', textContent: limits(scene) }));
        return;
      }
      const has = (name) => name.toLowerCase().includes(wanted);
      const objects = provenance.objects.map((name, id) => [name, id]).filter(([name]) => has(name)).map(([, id]) => id);
      const groups = [...provenance.groups.values()].filter((group) => has(group.name));
      const count = `${counted(objects.length, 'object')} and ${counted(groups.length, 'group')} found`;
      found.replaceChildren(
        element('p', { className: 'small', textContent: count }),
        listed(objects.slice(0, 1000).map(lineOfObject), 'object'),
        listed(groups.slice(0, 1000).map(lineOfGroup), 'group'),
      );
    };
    byId('search').addEventListener('input', update);
    update();
  }

  /// What can be searched, and what is left out.
  function limits(scene) {
    const { objects, links } = scene;
    const side = scene.after ?? scene.before;
    const part = (listedCount, all, what) =>
      listedCount < all ? `${number(listedCount)} of ${counted(all, what)}` : counted(all, what);
    const cut = links.links.length < links.in_all ? `; ${number(links.in_all - links.links.length)} connections are left out` : '';
    return `${part(objects.names.length, objects.in_all, 'object')} and ${part(side.groups.length, side.groups_in_all, 'group')} can be found here${cut}.`;
  }

  // --- 3D pane -------------------------------------------------------------------------------------------------------

  /// Shows the pane; returns a function that selects a group of the last side.
  function startPane(scene, provenance) {
    const panel = byId('pane-group');
    const hint = 'Click a box, or press N with the picture in focus, to see a group.';
    const last = scene.after ? 'after' : 'before';
    const sides = new Map(
      ['before', 'after'].filter((name) => scene[name]).map((name) => [name, { ...scene[name], isLast: name === last }]),
    );
    let shown = last;
    const describe = (id) => {
      const side = sides.get(shown);
      const group = side.groups.find((group) => group.id === id);
      const unlisted = element('p', { textContent: `Group ${id} is not one of the ${number(side.groups.length)} largest, which are listed.` });
      panel.replaceChildren(...(id === null ? [element('p', { textContent: hint })] : group ? describedGroup(provenance, group, side) : [unlisted]));
    };
    const note = () => {
      const { preview, instances, instances_in_all: all } = sides.get(shown);
      const surface = preview.shown < preview.placed ? `a preview of ${counted(preview.shown, 'triangle')} for ${number(preview.placed)}` : `all ${counted(preview.placed, 'triangle')}`;
      const boxes = instances.length < all ? `the ${number(instances.length)} largest boxes of ${counted(all, 'instance')}` : `the ${all === 1 ? 'box' : 'boxes'} of ${counted(all, 'instance')}`;
      byId('pane-note').textContent = `Shown: ${surface} and ${boxes}. Objects far outside the scene, such as sky domes, have no surface here.`;
    };
    let pane = null;
    try {
      pane = globalThis.raykilnPane.create(byId('pane'), sides, describe);
    } catch (error) {
      byId('pane').replaceChildren(element('p', { className: 'message', textContent: `The 3D view needs WebGL, which this browser does not offer here (${error.message}).` }));
      byId('pane-choices').hidden = true;
    }
    const select = (id) => {
      if (sides.size > 1 && shown !== last) {
        document.querySelector(`input[name="side"][value="${last}"]`).click();
      }
      pane ? pane.select(id) : describe(id);
      byId('space').scrollIntoView({ block: 'start' });
    };
    describe(null);
    note();
    if (!pane) return select;
    for (const radio of document.querySelectorAll('input[name="side"]')) {
      if (!sides.has('after')) byId('pane-sides').hidden = true;
      radio.addEventListener('change', () => {
        shown = sides.has(radio.value) ? radio.value : last;
        pane.show(shown);
        note();
      });
    }
    const options = { surface: 'pane-surface', boxes: 'pane-boxes', colours: 'pane-colours' };
    const apply = () => pane.set(Object.fromEntries(Object.entries(options).map(([key, id]) => [key, byId(id).checked])));
    for (const id of Object.values(options)) byId(id).addEventListener('change', apply);
    byId('pane-reset').addEventListener('click', () => pane.reset());
    document.addEventListener('theme', () => pane.restyle());
    pane.show(shown);
    return select;
  }

  startTheme();
  startDownload();
  startPictures();
  startRounds();
  const scene = dataOf('scene-data');
  if (scene) {
    const provenance = new Provenance(scene);
    startSearch(provenance, scene, startPane(scene, provenance));
  }
})();
