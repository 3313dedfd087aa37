"""The only script of a page; its hash stands in the page's content policy.

Everything can be seen without it: see ``rift_cl.report.html_page.pictures``.
"""

SCRIPT = """
document.documentElement.classList.add("live");
for (const figure of document.querySelectorAll("figure.slider")) {
  const pictures = figure.querySelectorAll("img"), said = figure.querySelector("output");
  figure.querySelector("[type=range]").addEventListener("input", (event) => {
    pictures.forEach((img, k) => img.classList.toggle("shown", k === +event.target.value));
    said.textContent = pictures[event.target.value].dataset.label;
  });
}
for (const pair of document.querySelectorAll(".pair")) {
  pair.querySelector("[type=range]").addEventListener("input", (event) => {
    pair.style.setProperty("--at", event.target.value + "%");
  });
}
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape")
    document.querySelectorAll(".zoom:checked").forEach((box) => { box.checked = false; });
});
"""
