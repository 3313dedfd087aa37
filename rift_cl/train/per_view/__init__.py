"""What is fitted for each view beside the splats: poses and exposures, by Adam on the host."""
