// Theme, table, copy buttons, and the start.

function startTheme() {
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const stored = () => { try { return localStorage.getItem("onespp-theme"); } catch { return null; } };
  const show = (theme) => {
    if (theme) root.dataset.theme = theme;
    const isDark = theme ? theme === "dark" : dark.matches;
    byId("theme").setAttribute("aria-pressed", String(isDark));
    byId("theme").querySelector("span").textContent = isDark ? "Light" : "Dark";
  };
  show(stored());
  dark.addEventListener("change", () => show(root.dataset.theme));
  byId("theme").addEventListener("click", () => {
    const theme = (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches) ? "light" : "dark";
    try { localStorage.setItem("onespp-theme", theme); } catch { /* it lasts until the page is closed */ }
    show(theme);
  });
}

/** Sort the table by a column; again: the other way round. Rows without a value come last. */
function sortBy(header) {
  const table = header.closest("table");
  const body = table.tBodies[0];
  const column = header.cellIndex;
  const down = header.getAttribute("aria-sort") === "descending";
  const number = (row) => parseFloat(row.cells[column].textContent.replace("−", "-"));
  const rows = [...body.rows];
  const numeric = rows.some((row) => !Number.isNaN(number(row)));
  rows.sort((p, q) => {
    if (!numeric) return (down ? 1 : -1) * q.cells[column].textContent.localeCompare(p.cells[column].textContent);
    const [u, v] = [number(p), number(q)];
    if (Number.isNaN(u) || Number.isNaN(v)) return Number.isNaN(u) - Number.isNaN(v);
    return down ? u - v : v - u;
  });
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  header.setAttribute("aria-sort", down ? "ascending" : "descending");
  body.append(...rows);
}

function start() {
  startTheme();
  for (const button of document.querySelectorAll("th button")) button.addEventListener("click", () => sortBy(button.closest("th")));
  for (const cell of document.querySelectorAll("[data-method]")) {
    const method = METHOD[cell.dataset.method];
    if (method) cell.prepend(swatch(method));
  }
  for (const button of document.querySelectorAll("[data-copy]")) {
    button.addEventListener("click", async () => {
      const done = await copy(button.closest("li").querySelector("code").textContent);
      button.textContent = done ? "Copied" : "Select and copy";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
  }
  const linked = location.hash.includes("=");
  let charts = null;
  const viewer = new Viewer((frame) => charts?.setFrame(frame));
  new Controls(viewer);
  charts = new Charts((frame) => { viewer.touched = true; viewer.set({ frame }); },
    (name) => { viewer.touched = true; viewer.set({ b: name, cb: "result" }); byId("viewer").scrollIntoView({ block: "start" }); });
  viewer.showControls();  // menus have their entries by now
  charts.setFrame(viewer.state.frame);
  if (linked) byId("viewer").scrollIntoView({ block: "start", behavior: "instant" });
}

start();
