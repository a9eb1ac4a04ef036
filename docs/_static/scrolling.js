// What scrolls sideways on a narrow window can be reached by key; not every browser sees to that by itself.
addEventListener("load", () => {
  const boxes = document.querySelectorAll("article .scroll, article .table-wrapper, article pre, article .cell_output");
  const see = () => {
    for (const box of boxes) {
      if (box.scrollWidth <= box.clientWidth) {
        box.removeAttribute("tabindex");
        box.role = box.ariaLabel = null;
      } else Object.assign(box, {tabIndex: 0, role: "group", ariaLabel: "scrolls sideways"});
    }
  };
  const observer = new ResizeObserver(see);
  boxes.forEach(box => observer.observe(box));
  see();
});
