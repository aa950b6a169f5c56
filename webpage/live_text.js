export default {
  template: `<span>{{ text }}</span>`,
  props: { value: String },
  data() {
    return { text: this.value };
  },
  watch: {
    value(value) {
      this.text = value;
    },
  },
  methods: {
    show(text) {
      this.text = text;
    },
  },
};
