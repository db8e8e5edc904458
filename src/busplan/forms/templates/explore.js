// Shows the setting that the sliders choose. Every figure stands in the page's own table: nothing is computed here.
"use strict";
for (const explorer of document.querySelectorAll(".explorer")) {
  const { labels, texts, settings } = JSON.parse(explorer.querySelector("[type='application/json']").textContent);
  const sliders = [...explorer.querySelectorAll("input")];
  const maps = [...explorer.querySelectorAll(".maps > *")];
  const card = explorer.querySelector(".judged");
  const element = (name, css, text = "") => {
    const made = document.createElement(name);
    made.className = css;
    made.textContent = text;
    return made;
  };
  const frames = maps.map((map) =>
    // A width in percent is that of a cell; the legend's is not.
    [...map.querySelectorAll(":is(.halo, .frame)[width$='%']")].map((box) => ({
      box, row: +sliders[0].value, column: +sliders[1].value,
      y: +box.getAttribute("y"), height: +box.getAttribute("height"), width: parseFloat(box.getAttribute("width")),
    })));

  function showCard(setting) {
    const [subject, word, state, gauge, lines] = setting ?? ["", "CANNOT EXIST", "neutral", null, []];
    card.className = `judged ${state}`;
    card.querySelector(".question").textContent = setting ? texts[subject] : "These values";
    card.querySelector(".answer").textContent = setting ? texts[word] : word;
    const bar = card.querySelector(".gauge");
    if (bar) {
      bar.style.visibility = gauge ? "visible" : "hidden";
      const title = bar.querySelector("title");
      title.textContent = (gauge ?? []).filter(([name]) => name !== "end").map(([name, from, to]) =>
        `${name.split(" ")[0]} ${Math.round(to - from)} %`).join(", ");
      bar.replaceChildren(title, ...(gauge ?? []).map(([name, from, to]) => {
        const box = document.createElementNS("http://www.w3.org/2000/svg", "rect");
        const width = name === "end" ? 2 : `${to - from}%`;
        for (const [key, value] of Object.entries({ class: name, x: `${from}%`, y: 0, width, height: 14 }))
          box.setAttribute(key, value);
        return box;
      }));
    }
    card.querySelector(".card").replaceChildren(...lines.map(([label, text, css]) => {
      const row = element("div", "");
      row.append(element("dt", "", labels[label]), element("dd", css, texts[text]));
      return row;
    }));
  }

  function show() {
    const [row, column, map = 0] = sliders.map((slider) => +slider.value);
    for (const slider of sliders) {
      const text = slider.dataset.values.split("\n")[slider.value];
      slider.nextElementSibling.textContent = text;
      slider.setAttribute("aria-valuetext", text);
    }
    maps.forEach((drawing, number) => { drawing.hidden = number !== map; });
    for (const frame of frames[map]) {
      frame.box.setAttribute("x", `${column * frame.width}%`);
      frame.box.setAttribute("y", frame.y + (frame.row - row) * frame.height);
    }
    showCard(settings[map][row * (+sliders[1].max + 1) + column]);
  }

  maps.forEach((map, number) => map.addEventListener("click", (event) => {
    const place = frames[number][0];
    const box = place.box.getBoundingClientRect();
    const across = Math.floor((event.clientX - box.left) / (box.width || 1));
    const up = Math.floor((box.bottom - event.clientY) / (box.height || 1));
    const [row, column] = [+sliders[0].value + up, +sliders[1].value + across];
    if (row < 0 || row > +sliders[0].max || column < 0 || column > +sliders[1].max) return;
    [sliders[0].value, sliders[1].value] = [row, column];
    show();
  }));
  sliders.forEach((slider) => slider.addEventListener("input", show));
  explorer.querySelector("fieldset").hidden = false;
  show();
}
