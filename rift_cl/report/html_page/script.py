"""The only script of a page; its hash stands in the page's content policy.

Everything can be seen without it: see ``rift_cl.report.html_page.pictures``.
"""

SCRIPT = """
document.documentElement.classList.add("live");
for (const figure of document.querySelectorAll("figure.slider")) {
  const pictures = figure.querySelectorAll("img"), said = figure.querySelector("output");
  const slide = figure.querySelector("[type=range]");
  const tell = () => { slide.setAttribute("aria-valuetext", said.textContent); };
  slide.addEventListener("input", () => {
    pictures.forEach((img, k) => img.classList.toggle("shown", k === +slide.value));
    said.textContent = pictures[slide.value].dataset.label;
    tell();
  });
  tell();
  figure.querySelector(".frames").removeAttribute("tabindex");
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
